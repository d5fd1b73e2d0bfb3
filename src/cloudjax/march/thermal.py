"""Thermal radiation that the layers of a scene emit, one in front of the other."""

from collections.abc import Sequence
from typing import cast

import jax
import jax.numpy as jnp

from cloudjax.air.clear_air import Column
from cloudjax.light.bands import EmissiveBands
from cloudjax.light.emission import Factors

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


def emitted(scene: Scene, ways: Sequence[MarchedWay], column, background):
    """Find the emitted radiance of all cloud and its transmittance, [bands rays].

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
        for way, black, (seen, profile) in zip(ways, planck, shares, strict=True):
            unhidden = seen * way.unhidden(profiles)
            total = total + jnp.sum(unhidden * black[band], axis=-1)
            emitting = emitting + unhidden.sum(-1)
            through = through * profile[:, -1]
        if air is not None:
            # The air above is seen before what scatters as before what emits.
            total = total + jnp.maximum(1 - through - emitting, 0) * air[band]
        source.append(total)
        transmittance.append(through)
    return jnp.stack(source), jnp.stack(transmittance)


def _scattering(scene: Scene, way: MarchedWay) -> Factors | None:
    """What scattering changes, [bands nodes rays]; None for pure absorbers."""
    if scene.emission is None:
        return None
    depth = way.layer.absorptions_per_m[:, None, None] * way.passed.depth_m[None]
    each_band = jax.vmap(scene.emission, in_axes=(0, 0, None))
    return each_band(depth, way.layer.optics.emitters, way.view_height)


def _thermal_shares(way: MarchedWay, band: int, factors: Factors | None):
    """Of Planck's radiance of each step, and the transmittance to the steps' ends."""
    κ = way.layer.absorptions_per_m[band]
    absorbed = way.passed.absorbed(κ)
    if factors is None:
        return way.passed.mean(absorbed), way.passed.transmittance(κ)
    emitted, stopped = factors.emitted[band], factors.stopped[band]
    seen = way.passed.mean(absorbed * emitted[..., None])
    return seen, way.passed.transmittance(κ, stopped)
