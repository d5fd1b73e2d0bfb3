"""Rays see radiances and clouds, by pure functions of a scene and of a view."""

import functools as ft
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .background import background
from .marched_way import (
    MarchedWay,
    Seen,
    march_layers,
    seen_first,
    shares_of_ways,
    top_altitude_m,
)
from .products import CloudProducts, no_cloud, products_of
from .scene import BandRadiances, Scene
from .sunlight import beam, reflected
from .thermal import emitted
from .view import Surroundings, View


# Rays on which cloud is less likely are clear. Masks leave clear air a chance of 1e-4
# (`fraction_to_mask`).
LEAST_LIKELIHOOD = 1e-3


@jax.jit
def radiances(scene: Scene, view: View) -> BandRadiances:
    """Find what the rays of a view see of a scene.

    A pure function: `jax.jit`, `grad`, `jacfwd`, `jacrev` and `hessian` by the arrays
    of the scene, and `vmap` over scenes of one structure or over the rays of the view
    work on it. Rays on which cloud is less likely than half of `LEAST_LIKELIHOOD` see
    the clear sky, and up to that itself cloud fades in.

    **Returns:** radiances in the units of the bands, [bands rays]; of a view of one ray
    [bands].
    """
    return see(scene, view)[0]


@jax.jit
def products(scene: Scene, view: View) -> CloudProducts:
    """Find cover, optical depth, height and class of the cloud along each ray.

    As pure as `radiances`.
    """
    return see(scene, view)[1]


@jax.jit
def radiances_and_products(
    scene: Scene, view: View
) -> tuple[BandRadiances, CloudProducts]:
    """Find both from one march."""
    return see(scene, view)


def see(scene: Scene, view: View) -> tuple[BandRadiances, CloudProducts]:
    """Find both; what a compiled caller does not use is not computed."""
    if view.is_of_one_ray:
        return jax.tree.map(lambda x: x[..., 0], see(scene, view[None]))
    clear, clouds = see_clear(scene, view.around)
    if not view.samples:
        return clear, clouds
    ways = march_layers(scene, view)
    first = seen_first(ways)
    share = cloud_share(scene, view.samples, view.layer_of)
    seen = jax.tree.map(
        lambda some, none: _mixed(share, some, none),
        _cloudy(scene, view, ways, first),
        clear,
    )
    return seen, products_of(scene, ways, first, view.layer_of, share)


def see_clear(
    scene: Scene, around: Surroundings
) -> tuple[BandRadiances, CloudProducts]:
    """Find both for rays that meet no cloud."""
    behind = background(scene, around)
    reflective = behind.reflectance
    if scene.reflective is not None and reflective is not None:
        if behind.glint is not None:
            reflective = reflective + behind.glint
        reflective = scene.reflective.radiance(reflective)
    clouds = no_cloud(len(scene.layers), len(around.sun_direction))
    return BandRadiances(reflective, behind.radiance), clouds


def cloud_share(
    scene: Scene, samples: Sequence[Any], layer_of: Sequence[int]
) -> Float[Array, " rays"]:
    """Tell the rays that need be marched: 1 where any cloud is likely, 0 where none is.

    **Arguments:** `samples`: of each way, or the ways themselves.
    """
    shares = shares_of_ways(scene, samples, layer_of, LEAST_LIKELIHOOD)
    share = ft.reduce(jnp.maximum, shares)
    # Where no cloud is, the shadow of another may be.
    return share if scene.shadows is None else jnp.ones_like(share)


def _mixed(share, some, none):
    """Cloudy where the share is 1, clear where it is 0; neither is rounded there."""
    share = jnp.broadcast_to(share, some.shape)
    mixed = share * some + (1 - share) * none
    return jnp.where(share == 1, some, jnp.where(share == 0, none, mixed))


def _cloudy(
    scene: Scene, view: View, ways: Sequence[MarchedWay], first: Seen
) -> BandRadiances:
    behind, column = background(scene, view.around), view.around.column
    reflective = emissive = None
    if scene.reflective is not None and behind.reflectance is not None:
        bands, air = scene.reflective, None
        path = bands.path[:, None]
        if scene.air is not None and column is not None:
            top = top_altitude_m(ways, first)
            air = scene.air.veil(bands, column, scene.temperature, top)
            path = path + air.path
        source, passed = reflected(scene, ways, first, view, behind.reflectance, path)
        if air is not None and column is not None:
            source = air.over(source, column.sun)
        seen = under_air(source, passed, behind.reflectance, path, bands.gain)
        if behind.glint is not None:
            seen = seen + behind.glint * beam(ways, view.around.ground.sun_height)
        reflective = bands.radiance(seen)
    if scene.emissive is not None and behind.radiance is not None:
        source, passed = emitted(scene, ways, first, column)
        bands, clear = scene.emissive, behind.radiance
        emissive = under_air(source, passed, clear, bands.path[:, None], bands.gain)
    return BandRadiances(reflective, emissive)


def under_air(source, transmittance, background, path, gain):
    """Put cloud over the background, beneath the air above the cloud.

    The background is as seen from above the atmosphere and already holds the air's
    share. Beside the Earth it is black and holds none: cloud then hides what there is
    of the air's light, and never more than all of it, though between bright clouds
    more than all light may be passed on.
    """
    below = background - path
    passed = jnp.where(below < 0, jnp.minimum(transmittance, 1), transmittance)
    return path + gain[:, None] * source + passed * below
