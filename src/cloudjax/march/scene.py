"""Scenes: layers of cloud over a background, seen in bands.

The work is in three parts, so that each is done as seldom as possible: `navigate` on
the host whenever rays, masks or winds change; `sample` on the device whenever textures
do; `radiances` for every change of the parameters. `imaging` does all three for whole
images.
"""

from collections.abc import Callable, Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from cloudjax.air.atmosphere import AbstractTemperature
from cloudjax.air.clear_air import Air, Column
from cloudjax.clouds.source import AbstractCloudSource
from cloudjax.geometry.footprint import POINT, Footprint
from cloudjax.geometry.geodesy import geodetic
from cloudjax.geometry.path import Profile, device_array, points_along
from cloudjax.geometry.rays import Rays
from cloudjax.geometry.shells import both_chords
from cloudjax.light.bands import EmissiveBands, ReflectiveBands
from cloudjax.light.emission import EmittingSlabs
from cloudjax.light.reflection import AbstractReflection, Scatterers

from .shadows import Passage, Shades, Shadows, find_shades


class Layer(eqx.Module):
    """A source of cloud and what its particles do to light.

    **Fields:**

    - `name`: of the cloud class.
    - `cloud`: where the cloud is.
    - `extinction_per_m`: β within the cloud in reflective bands.
    - `infrared_ratio`: absorption over β at the emissive reference band.
    - `co_albedo`: 1 - ω in each reflective band.
    - `relative_absorption`: of each emissive band, 1 at the reference band; that of the
      pure absorber that stands for the cloud (`Particles.effective_absorption_in`).
    - `steps`: of the march.
    - `asymmetry`: mean scattering cosine in each reflective band; for strategies that
      have a phase function.
    - `relative_extinction`: of each reflective band over β; None is one in all.
    - `thermal_co_albedo`, `thermal_asymmetry`: 1 - ω and mean scattering cosine in each
      emissive band; for scenes whose cloud scatters there.
    """

    cloud: AbstractCloudSource
    extinction_per_m: Float[Array, ""]
    infrared_ratio: Float[Array, ""]
    co_albedo: Float[Array, " reflective"]
    relative_absorption: Float[Array, " emissive"]
    name: str = eqx.field(static=True)
    steps: int = eqx.field(static=True, default=24)
    asymmetry: Float[Array, " reflective"] | None = None
    relative_extinction: Float[Array, " reflective"] | None = None
    thermal_co_albedo: Float[Array, " emissive"] | None = None
    thermal_asymmetry: Float[Array, " emissive"] | None = None

    @property
    def sunlit_per_m(self) -> Float[Array, " reflective"]:
        """Extinction in each reflective band."""
        if self.relative_extinction is None:
            return self.extinction_per_m * jnp.ones_like(self.co_albedo)
        return self.extinction_per_m * self.relative_extinction

    @property
    def scatterers(self) -> Scatterers:
        """Its particles in each reflective band."""
        none = jnp.zeros_like(self.co_albedo)
        return Scatterers(
            self.co_albedo, none if self.asymmetry is None else self.asymmetry
        )

    @property
    def returned_per_m(self) -> Float[Array, " reflective"]:
        """Of the light in each reflective band what is sent back: bβ (`shadows.py`)."""
        particles = self.scatterers
        turned = (1 - particles.co_albedo) * particles.asymmetry
        return self.sunlit_per_m * (1 - turned) / 2

    @property
    def absorptions_per_m(self) -> Float[Array, " emissive"]:
        """Of the pure absorber in each emissive band."""
        return self.extinction_per_m * (self.infrared_ratio * self.relative_absorption)

    @property
    def emitters(self) -> Scatterers:
        """Its particles in each emissive band, where thermal scattering is asked."""
        if self.thermal_co_albedo is None or self.thermal_asymmetry is None:
            raise ValueError(
                f"The layer {self.name} has no co-albedo or asymmetry in the thermal "
                "bands: give both, or leave the scene's emission None."
            )
        return Scatterers(self.thermal_co_albedo, self.thermal_asymmetry)


class BandRadiances(eqx.Module):
    """Radiances of a set of rays in the units of the bands; None where not asked.

    A band that sees the sun and emits too has a row in each: `Scene.total` adds them.
    """

    reflective: Float[Array, "reflective rays"] | None
    emissive: Float[Array, "emissive rays"] | None

    def __getitem__(self, index) -> "BandRadiances":
        """Those of some of the rays."""
        return jax.tree.map(lambda x: x[:, index], self)


class Scene(eqx.Module):
    """All that is seen, but for where from.

    **Fields:**

    - `layers`: in any order; their shells may overlap.
    - `reflective`, `emissive`: the bands that are asked; None leaves a part out of the
      computation altogether. A band may be in both, such as 3.9 µm by day.
    - `reflection`: the strategy for sunlight.
    - `temperature`: of the cloud and the air, by altitude.
    - `emission`: how cloud scatters thermal radiation; None takes it for an absorber.
    - `air`: above the clouds; None leaves it out.
    - `shadows`: how clouds shade each other; None where they do not.
    """

    layers: tuple[Layer, ...]
    reflective: ReflectiveBands | None
    emissive: EmissiveBands | None
    reflection: AbstractReflection
    temperature: AbstractTemperature
    emission: EmittingSlabs | None = None
    air: Air | None = None
    shadows: Shadows | None = None

    def __check_init__(self):
        if self.reflective is None and self.emissive is None:
            raise ValueError("A scene without bands shows nothing: ask at least one.")

    @property
    def bands(self) -> tuple[int, ...]:
        """Numbers, each once: bands that see the sun, then those that only emit."""
        groups = (self.reflective, self.emissive)
        numbers = (n for group in groups if group is not None for n in group.numbers)
        return tuple(dict.fromkeys(numbers))

    def total(self, seen: BandRadiances) -> Float[Array, "bands rays"]:
        """Reflected and emitted radiance together, one row for each of `bands`."""
        rows: dict[int, Array] = {}
        groups = (self.reflective, seen.reflective), (self.emissive, seen.emissive)
        for bands, parts in groups:
            if bands is not None and parts is not None:
                for number, part in zip(bands.numbers, parts, strict=True):
                    rows[number] = rows[number] + part if number in rows else part
        return jnp.stack([rows[number] for number in self.bands])


class View(eqx.Module):
    """Where a scene is seen from: the ways of rays through layers, and the sun.

    **Fields:**

    - `ways`: one for each layer, and more for layers that rays meet twice.
    - `start_m`: where each way begins along the ray, relative to the first.
    - `air_k`: temperature along each way; None where the scene's own or that
      of `column` serves.
    - `column`: the air along each ray; None for scenes without.
    - `sun_direction`: unit vector from the Earth, ECEF.
    - `layer_of`: the layer of each way.
    """

    ways: tuple[PyTree, ...]
    start_m: tuple[Float[Array, " rays"], ...]
    air_k: tuple[Profile, ...] | None
    column: Column | None
    sun_direction: Float[Array, "3"]
    layer_of: tuple[int, ...] = eqx.field(static=True)

    def __getitem__(self, index) -> "View":
        """That of some of the rays."""
        return _with_its_sun(self, lambda x: x[index])


def navigate(
    scene: Scene,
    rays: Rays,
    sun_direction: Float[np.ndarray, "3"],
    masks: Sequence | None = None,
    displacements: Sequence | None = None,
    temperature: Callable | None = None,
    profile: Callable | None = None,
    *,
    knots: int = 2,
    twice: bool = False,
    footprint: Footprint = POINT,
) -> View:
    """Lay the rays through all layers, on the host in float64.

    **Arguments:**

    - `sun_direction`: unit vector from the Earth to the sun, ECEF.
    - `masks`: for each layer a callable (latitude, longitude) → w, or None.
    - `displacements`: for each layer a displacement map, or one per texture, or None.
    - `temperature`: a callable (latitude, longitude, altitude_m) → kelvin, where air
      differs from place to place; None for that of the scene.
    - `profile`: of the air, as `Air.navigate` takes it.
    - `knots`: points of a chord between which masks, winds and temperatures are linear.
    - `twice`: follow rays that graze the Earth into a shell a second time.
    - `footprint`: of the pixels; textures averaged over it are read no more often than
      they can change.
    """
    none = [None] * len(scene.layers)
    column = None
    if scene.air is not None:
        column = scene.air.navigate(rays, sun_direction, scene.temperature, profile)
        temperature = None
    ways, entries, layer_of, air = [], [], [], []
    for i, (layer, mask, maps) in enumerate(
        zip(scene.layers, masks or none, displacements or none, strict=True)
    ):
        for chord in both_chords(rays, layer.cloud.shell)[: 1 + twice]:
            way = layer.cloud.navigate(
                rays, chord, mask, maps, knots=knots, footprint=footprint
            )
            ways.append(way)
            entries.append(chord.entry_m)
            layer_of.append(i)
            if temperature is not None and scene.emissive is not None:
                places = [geodetic(p) for p in points_along(rays, chord, knots)]
                known = [temperature(*place) for place in places]
                known = device_array(np.stack(known, axis=-1))
                air.append(Profile(known, ends=True))
    first = np.min(entries, axis=0) if entries else 0.0
    return View(
        tuple(ways),
        tuple(device_array(entry - first) for entry in entries),
        tuple(air) or None,
        column,
        device_array(sun_direction),
        tuple(layer_of),
    )


class Sampled(eqx.Module):
    """All that the parameters of a scene work on, for a set of rays.

    **Fields:**

    - `clouds`: of each way, what its source sampled.
    - `start_m`, `air_k`, `column`, `sun_direction`, `layer_of`: as in `View`.
    - `shades`: what is on the way to the sun; None without shadows. The points that are
      shaded are those of the parameters at hand: another set wants other samples.
    """

    clouds: tuple[PyTree, ...]
    air_k: tuple[Profile, ...] | None
    start_m: tuple[Float[Array, " rays"], ...]
    column: Column | None
    sun_direction: Float[Array, "3"]
    layer_of: tuple[int, ...] = eqx.field(static=True)
    shades: Shades | None = None

    def __getitem__(self, index) -> "Sampled":
        """Those of some of the rays."""
        # Components come first, so that rays are the second axis of three.
        return _with_its_sun(self, lambda x: x[:, index] if x.ndim == 3 else x[index])


def sample(scene: Scene, view: View, textures: tuple) -> Sampled:
    """Sample each layer's textures along its ways.

    **Arguments:** `textures`: of each layer.
    """
    clouds = tuple(
        scene.layers[i].cloud.sample(
            way,
            textures[i],
            steps=scene.layers[i].steps,
            with_gradient=(
                scene.reflective is not None and scene.reflection.sees_slopes
            ),
        )
        for i, way in zip(view.layer_of, view.ways, strict=True)
    )
    return Sampled(
        clouds,
        view.air_k,
        view.start_m,
        view.column,
        view.sun_direction,
        view.layer_of,
        _shades(scene, view, textures, clouds),
    )


def _shades(scene: Scene, view: View, textures: tuple, clouds: tuple) -> Shades | None:
    if scene.shadows is None or scene.reflective is None:
        return None
    passages = [
        Passage(
            layer.cloud,
            textures[i],
            way,
            samples,
            start,
            layer.returned_per_m,
            layer.steps,
        )
        for i, way, samples, start in zip(
            view.layer_of, view.ways, clouds, view.start_m, strict=True
        )
        for layer in [scene.layers[i]]
    ]
    return find_shades(scene.shadows, passages, view.layer_of, view.sun_direction)


def join(parts: Sequence[Sampled]) -> Sampled:
    """The samples of several sets of rays as those of one."""

    def together(*arrays):
        return jnp.concatenate(arrays, axis=1 if arrays[0].ndim == 3 else 0)

    return _with_its_sun(parts[0], together, *parts[1:])


def _with_its_sun(whole, change: Callable, *others):
    """A change to all leaves but the direction of the sun, which has no rays."""

    def sun(x):
        return x.sun_direction

    bare = [eqx.tree_at(sun, x, None) for x in (whole, *others)]
    changed = jax.tree.map(change, *bare)
    return eqx.tree_at(sun, changed, whole.sun_direction, is_leaf=lambda x: x is None)
