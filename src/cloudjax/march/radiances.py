"""From samples of the clouds to what the rays see of them."""

from collections.abc import Sequence
from typing import cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from cloudjax.air.clear_air import Column
from cloudjax.geometry.path import Path
from cloudjax.light.bands import EmissiveBands
from cloudjax.light.emission import Factors
from cloudjax.light.reflectance import above_horizon
from cloudjax.light.reflection import Illumination

from .march import March, first_surface, march
from .order import AbstractPlace, Stretch, overlap, place
from .scene import BandRadiances, Layer, Sampled, Scene
from .shadows import dimming


# Optical depth at which imagers begin to call a pixel cloudy.
VISIBLE_DEPTH = 0.3


class _Seen(eqx.Module):
    """A way, marched.

    **Fields:** `places`: where its steps lie on each of the other ways.
    """

    layer: Layer
    path: Path
    distance_m: Float[Array, "rays steps"]
    air_k: Float[Array, "rays steps"] | None
    passed: March
    places: tuple[AbstractPlace | None, ...]

    @property
    def altitude_m(self) -> Float[Array, "rays steps"]:
        return self.path.altitude_m(self.distance_m)

    @property
    def view_height(self) -> Float[Array, " rays"]:
        """Cosine of the viewer's zenith angle at the entry."""
        return jnp.abs(jnp.sum(self.path.entry_up * self.path.direction, axis=-1))

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
    paths = [samples.path for samples in sampled.clouds]
    distances = [
        path.distance_m(layer.steps) for layer, path in zip(layers, paths, strict=True)
    ]
    stretches = [
        Stretch(start, path.length_m)
        for start, path in zip(sampled.start_m, paths, strict=True)
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
                    distances[i],
                    overlapping=not same and overlap(*shells),
                )
            )

    return [
        _Seen(
            layer,
            path,
            distances[i],
            None if sampled.air_k is None else sampled.air_k[i].in_steps(layer.steps),
            march(layer.cloud.occupancy(samples, layer.steps), path.length_m),
            tuple(places(i)),
        )
        for i, (layer, samples, path) in enumerate(
            zip(layers, sampled.clouds, paths, strict=True)
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
        source, passed = _reflected(scene, ways, sampled, behind)
        path = bands.path[:, None]
        if scene.air is not None and sampled.column is not None:
            veil = scene.air.veil(bands, sampled.column, _top_m(ways))
            source = veil.over(source, sampled.column.sun)
            path = path + veil.path
        seen = _under_air(source, passed, behind, path, bands.gain)
        reflective = bands.radiance(seen)
    if scene.emissive is not None and background.emissive is not None:
        column = sampled.column
        source, passed = _emitted(scene, ways, column, background.emissive)
        bands, behind = scene.emissive, background.emissive
        emissive = _under_air(source, passed, behind, bands.path[:, None], bands.gain)
    return BandRadiances(reflective, emissive)


def _reflected(scene: Scene, ways: Sequence[_Seen], sampled: Sampled, background):
    """Reflectance factor of all cloud and its transmittance, [bands rays] both.

    A layer's light is dimmed by what lies in front of the part of it that is seen. What
    is behind a layer, of reflectance A, is lit by what the layer sends back too, and
    seen through it as t A/(1 - A R) (Liou 2002, eq. 6.3.31), R the layer's own.
    """
    # All bands in one, or the strategy would be compiled anew for each.
    each_band = jax.vmap(scene.reflection, in_axes=(0, 0, None))
    lights = [_illumination(way, sampled.sun_direction) for way in ways]
    returned = [
        each_band(
            way.layer.sunlit_per_m[:, None, None] * way.passed.depth_m[None],
            way.layer.scatterers,
            light,
        )
        for way, light in zip(ways, lights, strict=True)
    ]
    dimmed, ground = _shaded(scene, sampled)
    background = ground * background
    reflected = [
        jax.vmap(way.passed.mean)(dim * own.reflectance)
        for way, own, dim in zip(ways, returned, dimmed, strict=True)
    ]
    before = [_before(way, ways) for way in ways]
    passed = []
    for i, (way, light, own) in enumerate(zip(ways, lights, returned, strict=True)):
        behind = background
        for shares, other in zip(before, reflected, strict=True):
            if (share := shares[i]) is not None:
                behind = behind + share[None] * other
        albedo = jnp.clip(behind / above_horizon(light.sun_height)[None], 0, 1)
        # Never all of it, or light would not end.
        echo = jnp.minimum(albedo[:, None] * own.back, 0.99)
        passed.append(jax.vmap(way.passed.mean)(own.transmittance / (1 - echo)))
    source, transmittance = jnp.zeros_like(background), jnp.ones_like(background)
    for shares, own, left in zip(before, reflected, passed, strict=True):
        for share, through in zip(shares, passed, strict=True):
            if share is not None:
                own = own * (1 - share[None] * (1 - through))
        source, transmittance = source + own, transmittance * left
    return source, ground * transmittance


def _shaded(scene: Scene, sampled: Sampled):
    """What shadows leave of the light of each way's cloud, and of the ground's."""
    if sampled.shades is None:
        return [1.0] * len(sampled.layer_of), 1.0
    layers = scene.layers
    casters = [layer.cloud for layer in layers], [la.returned_per_m for la in layers]
    ways = [
        dimming(shades, *casters, own=i)
        for i, shades in zip(sampled.layer_of, sampled.shades.ways, strict=True)
    ]
    return ways, dimming(sampled.shades.ground, *casters)[:, 0]


def _before(way: _Seen, others: Sequence[_Seen]) -> list[Float[Array, " rays"] | None]:
    """The share of each other way's cloud that is in front of what is seen of one."""
    seen = way.passed.mean(way.passed.absorbed(way.layer.extinction_per_m))
    total = jnp.maximum(seen.sum(-1), 1e-9)
    shares = []
    for where, other in zip(way.places, others, strict=True):
        if where is None:
            shares.append(None)
            continue
        profile = other.passed.transmittance(other.layer.extinction_per_m)
        stopped = (1 - profile) / jnp.maximum(1 - profile[:, -1:], 1e-6)
        shares.append((seen * where.read(stopped)).sum(-1) / total)
    return shares


def _illumination(way: _Seen, sun: Float[Array, "3"]) -> Illumination:
    lit = shaded = None
    if way.passed.slopes is not None:
        surface = first_surface(
            way.passed.absorbed(way.layer.extinction_per_m),
            way.distance_m,
            way.passed.slopes,
            way.path.direction,
        )
        lit, shaded = surface.illumination(sun)
    return Illumination(
        lit,
        shaded,
        sun_height=jnp.sum(way.path.entry_up * sun[None], axis=-1),
        view_height=way.view_height,
        scattering=jnp.sum(way.path.direction * sun[None], axis=-1),
    )


def _black_bodies(scene: Scene, ways: Sequence[_Seen], column: Column | None):
    """Radiance of black bodies at the temperature of each step's altitude.

    Of each way [bands rays steps], through the air above where the scene has air; then
    also the radiance of that air, [bands rays], where cloud scatters.
    """
    bands = cast(EmissiveBands, scene.emissive)
    if scene.air is not None and column is not None:
        emission = scene.air.emission(bands, column, scene.temperature)
        black = [
            emission.black_bodies(way.altitude_m, way.layer.cloud.shell) for way in ways
        ]
        return black, None if scene.emission is None else emission.above(_top_m(ways))
    black = [
        bands.planck(
            scene.temperature(way.altitude_m) if way.air_k is None else way.air_k
        )
        for way in ways
    ]
    return black, None


def _emitted(scene: Scene, ways: Sequence[_Seen], column, background):
    """Emitted radiance of all cloud and its transmittance, [bands rays] both.

    Emission is integrated along the ray at the temperature of each step's altitude,
    with what scattering changes where the scene asks for it.
    """
    planck, air = _black_bodies(scene, ways, column)
    factors = [_scattering(scene, way) for way in ways]
    source, transmittance = [], []
    for band in range(background.shape[0]):
        shares = [
            _thermal_shares(way, band, changed)
            for way, changed in zip(ways, factors, strict=True)
        ]
        profiles = [profile for _, profile in shares]
        total = emitting = jnp.zeros_like(background[band])
        through = jnp.ones_like(background[band])
        for way, emitted, (seen, profile) in zip(ways, planck, shares, strict=True):
            unhidden = seen * way.unhidden(profiles)
            total = total + jnp.sum(unhidden * emitted[band], axis=-1)
            emitting = emitting + unhidden.sum(-1)
            through = through * profile[:, -1]
        if air is not None:
            # The air above is seen before what scatters as before what emits.
            total = total + jnp.maximum(1 - through - emitting, 0) * air[band]
        source.append(total)
        transmittance.append(through)
    return jnp.stack(source), jnp.stack(transmittance)


def _scattering(scene: Scene, way: _Seen) -> Factors | None:
    """What scattering changes, [bands nodes rays]; None for pure absorbers."""
    if scene.emission is None:
        return None
    depth = way.layer.absorptions_per_m[:, None, None] * way.passed.depth_m[None]
    each_band = jax.vmap(scene.emission, in_axes=(0, 0, None))
    return each_band(depth, way.layer.emitters, way.view_height)


def _thermal_shares(way: _Seen, band: int, factors: Factors | None):
    """Of Planck's radiance of each step, and the transmittance to the steps' ends."""
    κ = way.layer.absorptions_per_m[band]
    absorbed = way.passed.absorbed(κ)
    if factors is None:
        return way.passed.mean(absorbed), way.passed.transmittance(κ)
    emitted, stopped = factors.emitted[band], factors.stopped[band]
    seen = way.passed.mean(absorbed * emitted[..., None])
    return seen, way.passed.transmittance(κ, stopped)


def _under_air(source, transmittance, background, path, gain):
    """Cloud over the background, beneath the air above the cloud.

    The background is as seen from above the atmosphere and already holds the air's
    share.
    """
    return path + gain[:, None] * source + transmittance * (background - path)


def _stopped(ways: Sequence[_Seen]) -> list[Float[Array, "rays steps"]]:
    """Share of the light looking back that each step of each way stops."""
    profiles = [way.passed.transmittance(way.layer.extinction_per_m) for way in ways]
    return [
        way.passed.mean(way.passed.absorbed(way.layer.extinction_per_m))
        * way.unhidden(profiles)
        for way in ways
    ]


def _top_m(ways: Sequence[_Seen]) -> Float[Array, " rays"]:
    """Mean altitude of the first surface; 0 where nothing is met."""
    height = total = jnp.zeros_like(ways[0].path.length_m)
    for way, stopped in zip(ways, _stopped(ways), strict=True):
        height = height + (stopped * way.altitude_m).sum(-1)
        total = total + stopped.sum(-1)
    met = total > 1e-3
    return jnp.where(met, height / jnp.where(met, total, 1.0), 0.0)


class CloudProducts(eqx.Module):
    """What is known of the clouds of each ray beside their radiances.

    **Fields:**

    - `fraction`: of the pixel that cloud covers: where its optical depth exceeds 0.3,
      softly.
    - `depths`: optical depths of each layer at the reference band, as if looked at from
      straight above.
    - `top_height_m`: mean altitude of the first surface; NaN where nothing is met.
    - `share`: of the light looking back that each layer stops.
    """

    fraction: Float[Array, " rays"]
    depths: Float[Array, "layers rays"]
    top_height_m: Float[Array, " rays"]
    share: Float[Array, "layers rays"]

    @property
    def optical_depth(self) -> Float[Array | np.ndarray, " rays"]:
        """Of all layers."""
        return self.depths.sum(0)


def clear_products(layers: int, rays: int) -> CloudProducts:
    """Of rays that meet no cloud."""
    none, no_height = jnp.zeros((layers, rays)), jnp.full(rays, jnp.nan)
    return CloudProducts(jnp.zeros(rays), none, no_height, none)


def products(scene: Scene, sampled: Sampled) -> CloudProducts:
    """Cover, optical depth, height and class of the cloud along each ray."""
    ways = _march(scene, sampled)
    rays = ways[0].path.length_m.shape
    clear = jnp.ones(rays)
    depths = [jnp.zeros(rays) for _ in scene.layers]
    share = [jnp.zeros(rays) for _ in scene.layers]
    stops = _stopped(ways)
    for i, way, stopped in zip(sampled.layer_of, ways, stops, strict=True):
        β = way.layer.extinction_per_m
        vertical = β * way.passed.depth_m * way.view_height[None]
        squared = (vertical / VISIBLE_DEPTH) ** 2
        clear = clear * way.passed.mean(1 / (1 + squared))
        depths[i] = depths[i] + way.passed.mean(vertical)
        share[i] = share[i] + stopped.sum(-1)
    met = sum(share, jnp.zeros(rays)) > 1e-3
    top = jnp.where(met, _top_m(ways), jnp.nan)
    # Weights of a quadrature add up to one but for rounding.
    cover = jnp.clip(1 - clear, 0, 1)
    return CloudProducts(cover, jnp.stack(depths), top, jnp.stack(share))
