"""The layers of a scene send sunlight back, one in front of the other."""

import functools as ft
from collections.abc import Sequence

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from cloudjax.light.reflectance import above_horizon
from cloudjax.light.reflection import AbstractReflection, Illumination, Returned

from .alike import each_met
from .march import first_surface
from .marched_way import MarchedWay, Seen
from .scene import Scene
from .shadows import dimming
from .slabs import each_band, in_slabs
from .view import View


def reflected(
    scene: Scene, ways: Sequence[MarchedWay], first: Seen, view: View, background, path
):
    """Find the reflectance factor of all cloud and its transmittance, [bands rays].

    A layer's light is dimmed by what lies in front of the part of it that is seen. What
    is behind a layer, of reflectance A, is lit by what the layer sends back too, and
    seen through it as t A/(1 - A R) (Liou 2002, eq. 6.3.31), R the layer's own. Where
    there is no light at all, cloud is as good as clear air.

    **Arguments:** `path`: what the air in front of cloud sends back.
    """
    lights = [_illumination(way, view.around.sun_direction) for way in ways]
    lit = ((background != 0) | (path != 0)).any(0)
    lit = ft.reduce(jnp.logical_or, (light.sun_height > 0 for light in lights), lit)
    returned = _returned(scene.reflection, ways, lights, lit)
    dimmed, ground = _shaded(scene, view, ways)
    background = ground * background
    sent = [
        jax.vmap(way.passed.mean)(dim * own.reflectance)
        for way, own, dim in zip(ways, returned, dimmed, strict=True)
    ]
    before = [_before(i, first) for i in range(len(ways))]
    passed = []
    for i, (way, light, own) in enumerate(zip(ways, lights, returned, strict=True)):
        behind = background
        for shares, other in zip(before, sent, strict=True):
            if (share := shares[i]) is not None:
                behind = behind + share[None] * other
        albedo = jnp.clip(behind / above_horizon(light.sun_height)[None], 0, 1)
        # Never all of it, or light would not end.
        echo = jnp.minimum(albedo[:, None] * own.back, 0.99)
        passed.append(jax.vmap(way.passed.mean)(own.transmittance / (1 - echo)))
    source, transmittance = jnp.zeros_like(background), jnp.ones_like(background)
    for shares, own, left in zip(before, sent, passed, strict=True):
        for share, through in zip(shares, passed, strict=True):
            if share is not None:
                own = own * (1 - share[None] * (1 - through))
        source, transmittance = source + own, transmittance * left
    return source, ground * transmittance


def beam(
    ways: Sequence[MarchedWay], sun_height: Float[Array, " rays"]
) -> Float[Array, "bands rays"]:
    """Find what of the sun's beam comes through all cloud, down to the ground and up.

    It comes down through as much cloud as the view goes up through. What cloud scatters
    nearly forwards, g² of it (Joseph et al. 1976, J. Atmos. Sci. 33, 2452), stays in
    the beam.
    """

    def through(way):
        optics = way.layer.optics.scatterers
        kept = (1 - optics.co_albedo) * optics.asymmetry**2
        slant = 1 + way.view_height / above_horizon(sun_height)
        lost_per_m = (1 - kept) * way.layer.sunlit_per_m
        depth = lost_per_m[:, None, None] * (way.passed.depth_m * slant[None])[None]
        return jax.vmap(way.passed.mean)(jnp.exp(-depth))

    return ft.reduce(jnp.multiply, map(through, ways))


def _returned(
    reflection: AbstractReflection,
    ways: Sequence[MarchedWay],
    lights: Sequence[Illumination],
    lit: Bool[Array, " rays"],
) -> list[Returned]:
    """What becomes of sunlight in each way's cloud, [bands nodes rays]."""
    slabs = [
        (
            way.layer.sunlit_per_m[:, None, None]
            * jnp.where(lit, way.passed.depth_m, 0.0)[None],
            way.layer.optics.scatterers,
            light,
        )
        for way, light in zip(ways, lights, strict=True)
    ]

    def by_none(slab):
        return jax.vmap(Returned.by_none)(slab[0])

    def found(slab):
        if reflection.is_quick:
            return each_band(reflection)(*slab)
        depth, particles, light = slab
        return in_slabs(reflection, depth, particles, light, by_none(slab))

    return each_met(
        [way.met if way.met is True else way.met & lit.any() for way in ways],
        found,
        by_none,
        slabs,
    )


def _shaded(scene: Scene, view: View, ways: Sequence[MarchedWay]):
    """What shadows leave of the light of each way's cloud, and of the ground's."""
    if view.shades is None:
        return [1.0] * len(ways), 1.0
    layers = scene.layers
    casters = [layer.cloud for layer in layers], [la.returned_per_m for la in layers]
    dimmed = [
        dimming(shades, *casters, own=i, part=_turning_part(way))
        for i, way, shades in zip(view.layer_of, ways, view.shades.ways, strict=True)
    ]
    return dimmed, dimming(view.shades.ground, *casters)[:, 0]


def _turning_part(way: MarchedWay) -> Float[Array, " rays"]:
    """Where on its way through a layer the light turns, 0 to 1: weights exp(-bτ)."""
    returned = way.layer.returned_per_m.mean() * way.view_height[None, :, None]
    turned = jnp.exp(-returned * way.passed.cloud_m)
    weight = way.passed.mean(way.passed.segment_m * turned)
    total = jnp.maximum(weight.sum(-1), 1e-9)
    return jnp.sum(weight * way.part, axis=-1) / total


def _before(i: int, first: Seen) -> list[Float[Array, " rays"] | None]:
    """The share of each other way's cloud that is in front of what is seen of one."""
    own = first.stops[i].within
    total = jnp.maximum(own.sum(-1), 1e-9)
    shares = []
    for through, other in zip(first.behind[i], first.stops, strict=True):
        if through is None:
            shares.append(None)
            continue
        whole = jnp.maximum(1 - other.through[:, -1], 1e-6)
        shares.append((own * (1 - through)).sum(-1) / whole / total)
    return shares


def _illumination(way: MarchedWay, sun: Float[Array, "rays 3"]) -> Illumination:
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
        sun_height=jnp.sum(way.path.entry_up * sun, axis=-1),
        view_height=way.view_height,
        scattering=jnp.sum(way.path.direction * sun, axis=-1),
    )
