"""Thermal radiation that the layers of a scene emit, one in front of the other."""

from collections.abc import Sequence
from typing import cast

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from cloudjax.air.clear_air import Column
from cloudjax.light.bands import EmissiveBands
from cloudjax.light.emission import Factors

from .alike import each_met
from .marched_way import MarchedWay, top_altitude_m
from .scene import Scene


def _black_bodies(scene: Scene, ways: Sequence[MarchedWay], column: Column | None):
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
        return black, None if scene.emission is None else emission.above(
            top_altitude_m(ways)
        )
    black = [
        bands.planck(
            scene.temperature(way.altitude_m) if way.air_k is None else way.air_k
        )
        for way in ways
    ]
    return black, None


def emitted(scene: Scene, ways: Sequence[MarchedWay], column: Column | None):
    """Find the emitted radiance of all cloud and its transmittance, [bands rays].

    Emission is integrated along the ray at the temperature of each step's altitude,
    with what scattering changes where the scene asks for it.
    """
    planck, air = _black_bodies(scene, ways, column)
    factors = _scattering(scene, ways)
    absorptions = [way.layer.absorptions_per_m for way in ways]

    def one(band):
        per_m, factors, planck, air = band
        shares = [
            _thermal_shares(way, κ, changed)
            for way, κ, changed in zip(ways, per_m, factors, strict=True)
        ]
        profiles = [profile for _, profile in shares]
        total = emitting = jnp.zeros_like(profiles[0][:, 0])
        through = jnp.ones_like(total)
        for way, black, (seen, profile) in zip(ways, planck, shares, strict=True):
            unhidden = seen * way.unhidden(profiles)
            total = total + jnp.sum(unhidden * black, axis=-1)
            emitting = emitting + unhidden.sum(-1)
            through = through * profile[:, -1]
        if air is not None:
            # The air above is seen before what scatters as before what emits.
            total = total + jnp.maximum(1 - through - emitting, 0) * air
        return total, through

    # One after the other: what a band needs fits the cache, and is compiled once.
    return jax.lax.map(one, (absorptions, factors, planck, air))


def _scattering(scene: Scene, ways: Sequence[MarchedWay]) -> list[Factors | None]:
    """What scattering changes in each way, [bands nodes rays]; None for absorbers."""
    if scene.emission is None:
        return [None] * len(ways)
    each_band = jax.vmap(scene.emission, in_axes=(0, 0, None))
    slabs = [
        (
            way.layer.absorptions_per_m[:, None, None] * way.passed.depth_m[None],
            way.layer.optics.emitters,
            way.view_height,
        )
        for way in ways
    ]

    met = [way.met for way in ways]
    found = each_met(
        met,
        lambda slab: each_band(*slab),
        lambda slab: jax.vmap(Factors.of_absorber)(slab[0]),
        slabs,
    )
    return [*found]


def _thermal_shares(
    way: MarchedWay, absorption_per_m: Float[Array, ""], factors: Factors | None
):
    """Of Planck's radiance of each step, and the transmittance to the steps' ends."""
    absorbed = way.passed.absorbed(absorption_per_m)
    if factors is None:
        return way.passed.mean(absorbed), way.passed.transmittance(absorption_per_m)
    seen = way.passed.mean(absorbed * factors.emitted[..., None])
    return seen, way.passed.transmittance(absorption_per_m, factors.stopped)
