"""Rays, suns and places that are hard to look from."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np

from cloudjax import FixedGrid, StandardAtmosphere
from cloudjax.geometry.geodesy import ecef
from tests.extreme_scenes import Seen
from tests.helpers import limb_rays, rays_to

from .looks import CLOUDY, COUNT, SUNLIT, kelvin_of, mean, near, seen_by
from .rows import row


@row("Rays", "That graze the Earth")
def grazing() -> str:
    seen = seen_by(limb_rays(*np.linspace(-5e3, 11e3, COUNT)), mask=CLOUDY)
    assert seen.depth.max() > 0
    return f"Depth up to {seen.depth.max():.0f}; radiances and derivatives are finite."


@row("Rays", "That miss the Earth and all air")
def missing() -> str:
    seen = seen_by(limb_rays(*np.linspace(2e4, 3e6, COUNT)), mask=CLOUDY)
    assert np.abs(seen.radiance).max() == 0
    assert np.abs(seen.reverse).max() == 0
    return "Space: radiances and derivatives are exactly 0."


@row("Rays", "That start inside cloud")
def inside() -> str:
    below = near()
    inside = ecef(np.full(COUNT, 20.0), np.full(COUNT, 10.0), np.full(COUNT, 1600.0))
    rays = replace(below, origin_m=inside)
    seen = seen_by(rays, mask=CLOUDY, extinction_per_m=1.0)
    air = float(StandardAtmosphere()(jnp.asarray(1600.0)))
    assert seen.depth.min() > 100
    # Within a step of where they start; cloud scatters a little of what it emits.
    assert abs(kelvin_of(seen) - air) < 6
    return f"{kelvin_of(seen):.1f} K: the cloud around, in air of {air:.1f} K."


def _at(zenith: float) -> tuple[float, Seen]:
    seen = seen_by(near(spread=0.1), zenith=_over(zenith), mask=CLOUDY)
    return mean(seen, SUNLIT), seen


def _over(zenith: float) -> np.ndarray:
    """A sun at this distance from the zenith of 20 N 10 E."""
    φ, λ = np.radians([20.0, 10.0])
    up = np.array([np.cos(φ) * np.cos(λ), np.cos(φ) * np.sin(λ), np.sin(φ)])
    east = np.array([-np.sin(λ), np.cos(λ), 0])
    θ = np.radians(zenith)
    return np.cos(θ) * up + np.sin(θ) * east


@row("Sun", "Overhead")
def overhead() -> str:
    bright, _ = _at(0.0)
    low, _ = _at(60.0)
    assert bright > low > 0
    return f"{bright:.0f} W m⁻² sr⁻¹ µm⁻¹ in band 2; {low:.0f} with the sun at 30°."


@row("Sun", "At the horizon")
def horizon() -> str:
    (level, _), (above, _) = _at(90.0), _at(89.0)
    assert 0 <= level < above < 20
    return f"{level:.2f} W m⁻² sr⁻¹ µm⁻¹; {above:.2f} one degree higher: no jump."


@row("Sun", "Below the horizon, and behind the limb")
def night() -> str:
    for zenith in (95.0, 120.0, 180.0):
        dark, seen = _at(zenith)
        assert dark == 0
        assert kelvin_of(seen) > 200
    return "No sunlight at all; emission is as by day. Derivatives are finite."


@row("Places", "Poles")
def poles() -> str:
    found = []
    for latitude in (90.0, -90.0):
        above = ecef(np.array([latitude]), np.array([0.0]), np.array([8e5]))
        φ = np.sign(latitude) * (90 - np.linspace(0, 1, COUNT))
        ground = ecef(φ, np.linspace(-180, 180, COUNT), np.zeros(COUNT))
        found.append(seen_by(rays_to(above, ground), mask=0.5).cover.mean())
    return f"As elsewhere: mean cover {found[0]:.2f} and {found[1]:.2f}, all finite."


@row("Places", "The date line, and a satellite above it")
def date_line() -> str:
    covers = []
    for longitude in (179.999, -180.001, -179.999):
        seen = seen_by(near(0.0, longitude, spread=0.5), mask=0.0)
        covers.append(seen)
    # The same longitude, told in two ways.
    difference = np.abs(covers[0].radiance - covers[1].radiance).max()
    assert difference < 0.02
    grids = [FixedGrid.abi_meso(2.0, 0.0, λ, λ) for λ in (180.0, -180.0)]
    one, other = (grid.rays() for grid in grids)
    apart = np.abs(one.direction - other.direction).max()
    assert apart < 1e-12
    return (
        f"179.999° E and 180.001° W are one place (radiances differ by "
        f"{difference:.0e}), and ±180° are one satellite."
    )
