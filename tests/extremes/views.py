"""Rays, suns and places that are hard to look from."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np

from cloudjax import FixedGrid, MaskGrid, Rays, StandardAtmosphere
from cloudjax.geometry.geodesy import ecef
from tests.extreme_scenes import Seen
from tests.helpers import GEOSTATIONARY_M, limb_rays, rays_to, sun

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
    tenths = [_at(zenith)[0] for zenith in (90.1, 90.0, 89.9, 89.8)]
    above, _ = _at(89.0)
    level = tenths[1]
    # Measured: 0.12 to 0.35, where a tenth of the whole degree has 0.35.
    steps = np.diff(tenths)
    assert steps.min() >= 0
    assert steps.max() < 2 * 0.1 * (above - level)
    return (
        f"{level:.2f} W m⁻² sr⁻¹ µm⁻¹; {tenths[2]:.2f} a tenth of a degree higher and "
        f"{above:.2f} one degree: no jump."
    )


@row("Sun", "Below the horizon, and behind the limb")
def night() -> str:
    for zenith in (95.0, 120.0, 180.0):
        dark, seen = _at(zenith)
        assert dark == 0
        assert kelvin_of(seen) > 200
    return "No sunlight at all; emission is as by day. Derivatives are finite."


def _around(latitude: float) -> Rays:
    """From 800 km above a place on the meridian of 0, to places within a degree."""
    φ = np.radians(latitude)
    up, east = np.array([np.cos(φ), 0, np.sin(φ)]), np.array([0.0, 1.0, 0.0])
    north = np.cross(up, east)
    far = np.radians(np.linspace(0.02, 1, COUNT))[:, None]
    turn = np.linspace(0, 2 * np.pi, COUNT, endpoint=False)[:, None]
    level = np.cos(turn) * east + np.sin(turn) * north
    x, y, z = (np.cos(far) * up + np.sin(far) * level).T
    ground = np.degrees(np.arcsin(z)), np.degrees(np.arctan2(y, x))
    above = ecef(np.array([latitude]), np.array([0.0]), np.array([8e5]))
    return rays_to(above, ecef(*ground, np.zeros(COUNT)))


@row("Places", "Poles")
def poles() -> str:
    places = {φ: _around(φ) for φ in (90.0, -90.0, 45.0, -45.0)}
    kelvin = [kelvin_of(seen_by(rays, mask=CLOUDY)) for rays in places.values()]
    assert np.ptp(kelvin) < 0.01
    cover = {φ: seen_by(rays, mask=-1.0).cover for φ, rays in places.items()}
    pole, other = (np.concatenate([cover[φ], cover[-φ]]) for φ in (90.0, 45.0))
    noise = np.hypot(pole.std(), other.std()) / np.sqrt(len(pole))
    assert abs(pole.mean() - other.mean()) < 3 * noise
    return (
        f"As elsewhere: {kelvin[0]:.1f} K where all is cloud, as at 45 degrees; broken "
        f"cloud covers {pole.mean():.2f} and {other.mean():.2f}, and the draws of both "
        f"leave ±{noise:.2f}."
    )


def _change_over(longitude: float, mask: float | MaskGrid) -> float:
    """How sunlight changes within 0.002 degrees of longitude, from above 180 E: the
    mean at some latitudes."""
    φ = np.repeat(np.linspace(-30, 30, COUNT // 2), 2)
    λ = longitude + np.tile([-1e-3, 1e-3], COUNT // 2)
    origin = np.linalg.norm(GEOSTATIONARY_M) * np.array([-1.0, 0, 0])
    rays = rays_to(origin, ecef(φ, (λ + 180) % 360 - 180, np.zeros(COUNT)))
    light = seen_by(rays, zenith=sun(40.0, 0.0, 180.0), mask=mask).radiance[:, SUNLIT]
    return float(np.abs(np.diff(light.reshape(-1, 2))).mean())


def _masks() -> list[float | MaskGrid]:
    """One everywhere, and one that changes, on grids that begin at 0 and at 180 W."""
    fraction = np.random.default_rng(0).uniform(0, 1, (19, 36))
    latitude, longitude = np.linspace(-90, 90, 19), np.arange(0, 360, 10.0)
    grids = [
        MaskGrid.from_fraction(fraction, latitude, longitude - west)
        for west in (0, 180)
    ]
    return [-1.0, *grids]


@row("Places", "The date line, and a satellite above it")
def date_line() -> str:
    masks = _masks()
    for mask in masks[1:]:
        assert isinstance(mask, MaskGrid)
        φ, λ = np.linspace(-80, 80, 33), np.full(33, 179.999)
        # A cell of 10 degrees changes by 5 at the most.
        assert np.abs(mask(φ, λ) - mask(φ, -λ)).max() < 2e-3
    across = [_change_over(180.0, mask) for mask in masks]
    elsewhere = [
        np.mean([_change_over(λ, mask) for λ in (172.5, 177.5, 181.5, 185.0)])
        for mask in masks
    ]
    # Measured: 0.8 to 1.3 times as much; where a mask is held in the last cell of its
    # grid, 20 times.
    assert max(np.divide(across, elsewhere)) < 2
    same = [
        seen_by(near(0.0, longitude, spread=0.5), mask=0.0).radiance
        for longitude in (179.999, -180.001)
    ]
    difference = np.abs(same[0] - same[1]).max()
    assert difference < 0.02
    grids = [FixedGrid.abi_meso(2.0, 0.0, λ, λ) for λ in (180.0, -180.0)]
    one, other = (grid.rays() for grid in grids)
    assert np.abs(one.direction - other.direction).max() < 1e-12
    return (
        f"Within 0.002° across it sunlight changes by {across[0]:.1f} W m⁻² sr⁻¹ µm⁻¹, "
        f"elsewhere by {elsewhere[0]:.1f}; under masks on grids by {across[1]:.1f} and "
        f"{elsewhere[1]:.1f}. 179.999° E and 180.001° W are one place, and ±180° one "
        "satellite."
    )
