"""Scenes: layers of cloud over a background, seen in bands.

The work is in three parts, so that each is done as seldom as possible: `navigate` on
the host whenever rays, masks or winds change; `sample` on the device whenever textures
do; `radiances` for every change of the parameters. `render` does the last two, tile by
tile.
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
from .geodesy import up
from .light import AbstractReflection
from .march import March, first_surface, march
from .path import device_array
from .rays import Rays
from .source import AbstractCloudSource


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


class BandRadiances(eqx.Module):
    """Radiances of a set of rays in the units of the bands; None where not asked."""

    reflective: Float[Array, "reflective rays"] | None
    emissive: Float[Array, "emissive rays"] | None


class Scene(eqx.Module):
    """All that is seen, but for where from.

    **Fields:**

    - `layers`: from the highest to the lowest, which do not overlap.
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
    """Where a scene is seen from: each layer's ways, the sun, the local vertical."""

    ways: tuple[PyTree, ...]
    sun_direction: Float[Array, "3"]
    vertical: Float[Array, "rays 3"]

    @property
    def sun_height(self) -> Float[Array, " rays"]:
        """Cosine of the solar zenith angle at the ground."""
        return jnp.sum(self.vertical * self.sun_direction[None, :], axis=-1)


def navigate(
    scene: Scene,
    rays: Rays,
    sun_direction: Float[np.ndarray, "3"],
    masks: Sequence | None = None,
    displacements: Sequence | None = None,
) -> View:
    """Lay the rays through all layers, on the host in float64.

    **Arguments:**

    - `sun_direction`: unit vector from the Earth to the sun, ECEF.
    - `masks`: for each layer a callable (latitude, longitude) → w, or None.
    - `displacements`: for each layer a displacement map, or one per texture, or None.
    """
    none = [None] * len(scene.layers)
    ground, _ = rays.ground()
    ways = tuple(
        layer.cloud.navigate(rays, mask, maps)
        for layer, mask, maps in zip(
            scene.layers, masks or none, displacements or none, strict=True
        )
    )
    vertical = up(ground.latitude_deg, ground.longitude_deg)
    return View(ways, device_array(sun_direction), device_array(vertical))


def sample(scene: Scene, view: View, textures: tuple) -> tuple[PyTree, ...]:
    """Sample each layer's textures along its ways."""
    return tuple(
        layer.cloud.sample(
            way, own, steps=layer.steps, with_gradient=scene.reflective is not None
        )
        for layer, way, own in zip(scene.layers, view.ways, textures, strict=True)
    )


def radiances(
    scene: Scene, view: View, samples: tuple[PyTree, ...], background: BandRadiances
) -> BandRadiances:
    """What the rays see, from samples taken beforehand.

    **Arguments:** `background`: radiances at the top of the atmosphere without cloud.
    """
    marches = tuple(
        march(layer.cloud.occupancy(own), way.path.length_m)
        for layer, own, way in zip(scene.layers, samples, view.ways, strict=True)
    )
    reflective = emissive = None
    if scene.reflective is not None and background.reflective is not None:
        bands = scene.reflective
        parts = [
            _reflected(scene, layer, view, own, passed)
            for layer, own, passed in zip(scene.layers, samples, marches, strict=True)
        ]
        behind = bands.reflectance(background.reflective)
        reflective = bands.radiance(_composite(parts, behind, bands))
    if scene.emissive is not None:
        parts = [
            _emitted(scene, layer, own, passed)
            for layer, own, passed in zip(scene.layers, samples, marches, strict=True)
        ]
        emissive = _composite(parts, background.emissive, scene.emissive)
    return BandRadiances(reflective, emissive)


def _reflected(scene, layer: Layer, view: View, samples, passed: March):
    """Reflectance factor of a layer and its transmittance, [bands rays] both."""
    surface = first_surface(
        passed.absorbed(layer.extinction_per_m),
        samples.distance_m,
        cast(Array, passed.gradient),  # sampled wherever there are reflective bands
        samples.up,
    )
    facing = jnp.sum(surface.normal * view.sun_direction[:, None, None], axis=0)
    depth = layer.extinction_per_m * passed.depth_m
    reflectance = jnp.stack(
        [
            passed.mean(scene.reflection(depth, co_albedo, facing, view.sun_height))
            for co_albedo in layer.co_albedo
        ]
    )
    transmittance = passed.mean(jnp.exp(-depth))
    return reflectance, jnp.broadcast_to(transmittance, reflectance.shape)


def _emitted(scene, layer: Layer, samples, passed: March):
    """Emitted radiance of a layer and its transmittance, [bands rays] both.

    Emission is integrated along the ray at the temperature of each step's altitude.
    """
    planck = scene.emissive.planck(scene.temperature(samples.altitude_m))
    emitted, transmittance = [], []
    for band, relative in enumerate(layer.relative_absorption):
        extinction = layer.extinction_per_m * layer.infrared_ratio * relative
        seen = passed.mean(passed.absorbed(extinction))
        emitted.append(jnp.sum(seen * planck[band], axis=-1))
        transmittance.append(1 - jnp.sum(seen, axis=-1))
    return jnp.stack(emitted), jnp.stack(transmittance)


def _composite(parts, background, bands):
    """Layers front to back over the background, beneath the air above the cloud.

    The sub-pixel structures of different layers are independent, so that each layer is
    averaged over its own before it is laid over the next. The background is as seen
    from above the atmosphere and already holds the air's share.
    """
    source = jnp.zeros_like(background)
    transmittance = jnp.ones_like(background)
    for emitted, passed in parts:
        source = source + transmittance * emitted
        transmittance = transmittance * passed
    path, gain = bands.path[:, None], bands.gain[:, None]
    return path + gain * source + transmittance * (background - path)


# Compiled apart: in one piece XLA would fuse the reads of textures into all that uses
# them, and repeat them.
_sample = eqx.filter_jit(sample)
_radiances = eqx.filter_jit(radiances)


def render(
    scene: Scene,
    view: View,
    textures: tuple,
    background: BandRadiances,
    *,
    tile: int = 4096,
) -> BandRadiances:
    """March all rays, a tile that fits the cache at a time.

    The tiles are a loop on the host around compiled functions: within `lax.map` a CPU
    gives each operation one core only. The result does not depend on `tile`.
    """
    rays = view.vertical.shape[0]
    tile = min(tile, rays)
    parts = []
    for start in range(0, rays, tile):
        # Copies of the last ray fill the last tile up, so that one compilation serves.
        index = np.minimum(np.arange(start, start + tile), rays - 1)
        ways = jax.tree.map(lambda x, index=index: x[index], view.ways)
        part = View(ways, view.sun_direction, view.vertical[index])
        behind = jax.tree.map(lambda x, index=index: x[:, index], background)
        samples = _sample(scene, part, textures)
        parts.append(_radiances(scene, part, samples, behind))
    return jax.tree.map(lambda *x: jnp.concatenate(x, axis=1)[:, :rays], *parts)
