"""Scenes: layers of cloud over a background, seen in bands.

The work is in three parts, so that each is done as seldom as possible: `navigate` on
the host whenever rays, masks or winds change; `sample` on the device whenever textures
do; `radiances` for every change of the parameters. `imaging` does all three for whole
images.
"""

from collections.abc import Sequence
from typing import cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from .atmosphere import AbstractTemperature
from .bands import EmissiveBands, ReflectiveBands
from .light import AbstractReflection, Illumination
from .march import March, first_surface, march
from .order import Place, Stretch, overlap, place
from .path import Path, device_array
from .rays import Rays
from .shell import chords, second_chords
from .source import AbstractCloudSource


# Optical depth at which imagers begin to call a pixel cloudy.
VISIBLE_DEPTH = 0.3


class Layer(eqx.Module):
    """A source of cloud and what its particles do to light.

    **Fields:**

    - `name`: of the cloud class.
    - `cloud`: where the cloud is.
    - `extinction_per_m`: β within the cloud in reflective bands.
    - `infrared_ratio`: absorption over β at the emissive reference band.
    - `co_albedo`: 1 - ω in each reflective band.
    - `relative_absorption`: of each emissive band, 1 at the reference band.
    - `steps`: of the march.
    """

    cloud: AbstractCloudSource
    extinction_per_m: Float[Array, ""]
    infrared_ratio: Float[Array, ""]
    co_albedo: Float[Array, " reflective"]
    relative_absorption: Float[Array, " emissive"]
    name: str = eqx.field(static=True)
    steps: int = eqx.field(static=True, default=24)

    def absorption_per_m(self, band: int) -> Float[Array, ""]:
        """In an emissive band, by its place in the scene."""
        return self.extinction_per_m * (
            self.infrared_ratio * self.relative_absorption[band]
        )


class BandRadiances(eqx.Module):
    """Radiances of a set of rays in the units of the bands; None where not asked."""

    reflective: Float[Array, "reflective rays"] | None
    emissive: Float[Array, "emissive rays"] | None


class Scene(eqx.Module):
    """All that is seen, but for where from.

    **Fields:**

    - `layers`: in any order; their shells may overlap.
    - `reflective`, `emissive`: the bands that are asked; None leaves a part out of the
      computation altogether.
    - `reflection`: the strategy for sunlight.
    - `temperature`: of the cloud, by altitude.
    """

    layers: tuple[Layer, ...]
    reflective: ReflectiveBands | None
    emissive: EmissiveBands | None
    reflection: AbstractReflection
    temperature: AbstractTemperature

    def __check_init__(self):
        if self.reflective is None and self.emissive is None:
            raise ValueError("A scene without bands shows nothing: ask at least one.")


class View(eqx.Module):
    """Where a scene is seen from: the ways of rays through layers, and the sun.

    **Fields:**

    - `ways`: one for each layer, and more for layers that rays meet twice.
    - `start_m`: where each way begins along the ray, relative to the first.
    - `sun_direction`: unit vector from the Earth, ECEF.
    - `layer_of`: the layer of each way.
    """

    ways: tuple[PyTree, ...]
    start_m: tuple[Float[Array, " rays"], ...]
    sun_direction: Float[Array, "3"]
    layer_of: tuple[int, ...] = eqx.field(static=True)


def navigate(
    scene: Scene,
    rays: Rays,
    sun_direction: Float[np.ndarray, "3"],
    masks: Sequence | None = None,
    displacements: Sequence | None = None,
    *,
    knots: int = 2,
    twice: bool = False,
) -> View:
    """Lay the rays through all layers, on the host in float64.

    **Arguments:**

    - `sun_direction`: unit vector from the Earth to the sun, ECEF.
    - `masks`: for each layer a callable (latitude, longitude) → w, or None.
    - `displacements`: for each layer a displacement map, or one per texture, or None.
    - `knots`: points of a chord between which masks and winds are linear.
    - `twice`: follow rays that graze the Earth into a shell a second time.
    """
    none = [None] * len(scene.layers)
    ways, entries, layer_of = [], [], []
    for i, (layer, mask, maps) in enumerate(
        zip(scene.layers, masks or none, displacements or none, strict=True)
    ):
        found = [chords(rays, layer.cloud.shell)]
        if twice:
            found.append(second_chords(rays, layer.cloud.shell))
        for chord in found:
            ways.append(layer.cloud.navigate(rays, chord, mask, maps, knots=knots))
            entries.append(chord.entry_m)
            layer_of.append(i)
    first = np.min(entries, axis=0) if entries else 0.0
    return View(
        tuple(ways),
        tuple(device_array(entry - first) for entry in entries),
        device_array(sun_direction),
        tuple(layer_of),
    )


class Sampled(eqx.Module):
    """All that the parameters of a scene work on, for a set of rays.

    **Fields:**

    - `clouds`: of each way, what its source sampled.
    - `paths`, `start_m`, `sun_direction`, `layer_of`: as in `View`.
    """

    clouds: tuple[PyTree, ...]
    paths: tuple[Path, ...]
    start_m: tuple[Float[Array, " rays"], ...]
    sun_direction: Float[Array, "3"]
    layer_of: tuple[int, ...] = eqx.field(static=True)


def sample(scene: Scene, view: View, textures: tuple) -> Sampled:
    """Sample each layer's textures along its ways.

    **Arguments:** `textures`: of each layer.
    """
    clouds = tuple(
        scene.layers[i].cloud.sample(
            way,
            textures[i],
            steps=scene.layers[i].steps,
            with_gradient=scene.reflective is not None,
        )
        for i, way in zip(view.layer_of, view.ways, strict=True)
    )
    paths = tuple(way.path for way in view.ways)
    return Sampled(clouds, paths, view.start_m, view.sun_direction, view.layer_of)


def join(parts: Sequence[Sampled]) -> Sampled:
    """The samples of several sets of rays as those of one."""

    def together(*arrays):
        # Components come first, so that rays are the second axis of three.
        return jnp.concatenate(arrays, axis=1 if arrays[0].ndim == 3 else 0)

    sun = parts[0].sun_direction
    bare = [eqx.tree_at(lambda p: p.sun_direction, p, None) for p in parts]
    joined = jax.tree.map(together, *bare)
    return eqx.tree_at(
        lambda p: p.sun_direction, joined, sun, is_leaf=lambda x: x is None
    )


class _Seen(eqx.Module):
    """A way, marched.

    **Fields:** `places`: where its steps lie on each of the other ways.
    """

    layer: Layer
    samples: PyTree
    path: Path
    passed: March
    places: tuple[Place | None, ...]

    def unhidden(
        self, profiles: Sequence[Float[Array, "rays nodes"]]
    ) -> Float[Array, "rays points"]:
        """Transmittance of all other ways in front of each step."""
        clear = jnp.ones_like(self.path.length_m)[:, None]
        for where, profile in zip(self.places, profiles, strict=True):
            if where is not None:
                clear = clear * where.read(profile)
        return clear


def _march(scene: Scene, sampled: Sampled) -> list[_Seen]:
    layers = [scene.layers[i] for i in sampled.layer_of]
    stretches = [
        Stretch(start, path.length_m)
        for start, path in zip(sampled.start_m, sampled.paths, strict=True)
    ]

    def places(i):
        for j, stretch in enumerate(stretches):
            same = sampled.layer_of[i] == sampled.layer_of[j]
            shells = layers[i].cloud.shell, layers[j].cloud.shell
            yield (
                None
                if i == j
                else place(
                    stretch,
                    layers[j].steps,
                    stretches[i],
                    sampled.clouds[i].distance_m,
                    overlapping=not same and overlap(*shells),
                )
            )

    return [
        _Seen(
            layer,
            samples,
            path,
            march(layer.cloud.occupancy(samples), path.length_m),
            tuple(places(i)),
        )
        for i, (layer, samples, path) in enumerate(
            zip(layers, sampled.clouds, sampled.paths, strict=True)
        )
    ]


def radiances(
    scene: Scene, sampled: Sampled, background: BandRadiances
) -> BandRadiances:
    """What the rays see, from samples taken beforehand.

    **Arguments:** `background`: radiances at the top of the atmosphere without cloud.
    """
    ways = _march(scene, sampled)
    reflective = emissive = None
    if scene.reflective is not None and background.reflective is not None:
        bands = scene.reflective
        behind = bands.reflectance(background.reflective)
        source, passed = _reflected(scene, ways, sampled.sun_direction, behind)
        reflective = bands.radiance(_under_air(source, passed, behind, bands))
    if scene.emissive is not None and background.emissive is not None:
        source, passed = _emitted(scene, ways, background.emissive)
        emissive = _under_air(source, passed, background.emissive, scene.emissive)
    return BandRadiances(reflective, emissive)


def _reflected(scene: Scene, ways: Sequence[_Seen], sun, background):
    """Reflectance factor of all cloud and its transmittance, [bands rays] both.

    A layer's light is dimmed by what lies in front of the part of it that is seen.
    """
    profiles = [way.passed.transmittance(way.layer.extinction_per_m) for way in ways]
    source, transmittance = jnp.zeros_like(background), jnp.ones_like(background)
    for way in ways:
        β = way.layer.extinction_per_m
        absorbed = way.passed.absorbed(β)
        light = _illumination(way, absorbed, sun)
        depth = β * way.passed.depth_m
        seen = way.passed.mean(absorbed)
        clear = (seen * way.unhidden(profiles)).sum(-1) / jnp.maximum(
            seen.sum(-1), 1e-9
        )
        reflectance = jnp.stack(
            [
                way.passed.mean(scene.reflection(depth, co_albedo, light))
                for co_albedo in way.layer.co_albedo
            ]
        )
        source = source + clear[None] * reflectance
        transmittance = transmittance * way.passed.mean(jnp.exp(-depth))[None]
    return source, transmittance


def _illumination(way: _Seen, absorbed, sun: Float[Array, "3"]) -> Illumination:
    surface = first_surface(
        absorbed,
        way.samples.distance_m,
        cast(Array, way.passed.gradient),  # sampled wherever there are reflective bands
        way.passed.slope_variance,
        way.samples.up,
        way.path.direction,
    )
    lit, shaded = surface.illumination(sun)
    return Illumination(lit, shaded, jnp.sum(way.path.entry_up * sun[None], axis=-1))


def _emitted(scene: Scene, ways: Sequence[_Seen], background):
    """Emitted radiance of all cloud and its transmittance, [bands rays] both.

    Emission is integrated along the ray at the temperature of each step's altitude.
    """
    bands = cast(EmissiveBands, scene.emissive)
    source, transmittance = [], []
    planck = [bands.planck(scene.temperature(way.samples.altitude_m)) for way in ways]
    for band in range(background.shape[0]):
        extinctions = [way.layer.absorption_per_m(band) for way in ways]
        pairs = list(zip(ways, extinctions, strict=True))
        profiles = [way.passed.transmittance(κ) for way, κ in pairs]
        total = jnp.zeros_like(background[band])
        through = jnp.ones_like(background[band])
        for (way, κ), emitted, profile in zip(pairs, planck, profiles, strict=True):
            seen = way.passed.mean(way.passed.absorbed(κ)) * way.unhidden(profiles)
            total = total + jnp.sum(seen * emitted[band], axis=-1)
            through = through * profile[:, -1]
        source.append(total)
        transmittance.append(through)
    return jnp.stack(source), jnp.stack(transmittance)


def _under_air(source, transmittance, background, bands):
    """Cloud over the background, beneath the air above the cloud.

    The background is as seen from above the atmosphere and already holds the air's
    share.
    """
    path, gain = bands.path[:, None], bands.gain[:, None]
    return path + gain * source + transmittance * (background - path)


class CloudProducts(eqx.Module):
    """What is known of the clouds of each ray beside their radiances.

    **Fields:**

    - `fraction`: of the pixel that cloud covers: where its optical depth exceeds 0.3,
      softly.
    - `optical_depth`: at the reference band, as if looked at from straight above.
    - `top_height_m`: mean altitude of the first surface; NaN where nothing is met.
    - `share`: of the light looking back that each layer stops.
    """

    fraction: Float[Array, " rays"]
    optical_depth: Float[Array, " rays"]
    top_height_m: Float[Array, " rays"]
    share: Float[Array, "layers rays"]


def products(scene: Scene, sampled: Sampled) -> CloudProducts:
    """Cover, optical depth, height and class of the cloud along each ray."""
    ways = _march(scene, sampled)
    profiles = [way.passed.transmittance(way.layer.extinction_per_m) for way in ways]
    rays = ways[0].path.length_m.shape
    clear, depth, height = jnp.ones(rays), jnp.zeros(rays), jnp.zeros(rays)
    share = [jnp.zeros(rays) for _ in scene.layers]
    for i, way in zip(sampled.layer_of, ways, strict=True):
        β = way.layer.extinction_per_m
        slant = jnp.abs((way.path.direction * way.path.entry_up).sum(-1))
        vertical = β * way.passed.depth_m * slant[None]
        squared = (vertical / VISIBLE_DEPTH) ** 2
        clear = clear * way.passed.mean(1 / (1 + squared))
        depth = depth + way.passed.mean(vertical)
        seen = way.passed.mean(way.passed.absorbed(β)) * way.unhidden(profiles)
        height = height + (seen * way.samples.altitude_m).sum(-1)
        share[i] = share[i] + seen.sum(-1)
    total = sum(share, jnp.zeros(rays))
    met = total > 1e-3
    top = jnp.where(met, height / jnp.where(met, total, 1.0), jnp.nan)
    return CloudProducts(1 - clear, depth, top, jnp.stack(share))
