"""The layers of a scene emit thermal radiation, one in front of the other."""

from collections.abc import Sequence
from typing import cast

import jax
import jax.numpy as jnp

from cloudjax.air.clear_air import Column
from cloudjax.light.bands import EmissiveBands
from cloudjax.light.emission import Factors

from .alike import each_met, if_met
from .marched_way import MarchedWay, Seen, seen, top_altitude_m
from .scene import Scene
from .slabs import in_slabs


def emitted(
    scene: Scene, ways: Sequence[MarchedWay], first: Seen, column: Column | None
):
    """Find the emitted radiance of all cloud and its transmittance, [bands rays].

    Emission is integrated along the ray at the temperature of each step's altitude,
    with what scattering changes where the scene asks for it.
    """
    planck, air = _black_bodies(scene, ways, first, column)
    factors = _scattering(scene, ways)
    absorptions = [way.layer.absorptions_per_m for way in ways]

    def one(band):
        per_m, factors, planck, air = band
        stops = [
            way.stops(κ, changed)
            for way, κ, changed in zip(ways, per_m, factors, strict=True)
        ]
        total = emitting = jnp.zeros_like(ways[0].path.length_m)
        through = jnp.ones_like(total)
        for black, part, own in zip(
            planck, seen(ways, stops).steps, stops, strict=True
        ):
            total = total + jnp.sum(part * black, axis=-1)
            emitting = emitting + part.sum(-1)
            through = through * own.through[:, -1]
        if air is not None:
            # The air above is seen before what scatters as before what emits.
            total = total + jnp.maximum(1 - through - emitting, 0) * air
        return total, through

    # One after the other: what a band needs fits the cache, and is compiled once.
    return jax.lax.map(one, (absorptions, factors, planck, air))


def _black_bodies(
    scene: Scene, ways: Sequence[MarchedWay], first: Seen, column: Column | None
):
    """Radiance of black bodies at the temperature of each step's altitude.

    Of each way [bands rays steps], through the air above where the scene has air; then
    also the radiance of that air, [bands rays], where cloud scatters.
    """
    bands = cast(EmissiveBands, scene.emissive)
    if scene.air is not None and column is not None:
        emission = scene.air.emission(bands, column, scene.temperature)
        black = [
            if_met(
                way.met,
                lambda emission, altitude_m, shell=way.layer.cloud.shell: (
                    emission.black_bodies(altitude_m, shell)
                ),
                0.0,
                emission,
                way.altitude_m,
            )
            for way in ways
        ]
        return black, None if scene.emission is None else emission.above(
            top_altitude_m(ways, first)
        )
    black = [
        bands.planck(
            scene.temperature(way.altitude_m) if way.air_k is None else way.air_k
        )
        for way in ways
    ]
    return black, None


def _scattering(scene: Scene, ways: Sequence[MarchedWay]) -> list[Factors | None]:
    """What scattering changes in each way, [bands nodes rays]; None for absorbers."""
    emission = scene.emission
    if emission is None:
        return [None] * len(ways)
    slabs = [
        (
            way.layer.absorptions_per_m[:, None, None] * way.passed.depth_m[None],
            way.layer.optics.emitters,
            way.view_height,
        )
        for way in ways
    ]

    def of_absorber(slab):
        return jax.vmap(Factors.of_absorber)(slab[0])

    found = each_met(
        [way.met for way in ways],
        lambda slab: in_slabs(emission, *slab, of_absorber(slab)),
        of_absorber,
        slabs,
    )
    return [*found]
