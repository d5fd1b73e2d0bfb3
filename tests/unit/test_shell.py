"""Chords through shells, seen from above, from within and from below."""

import numpy as np
import pytest

from cloudjax import Ellipsoid, Rays, Shell
from cloudjax.geometry.geodesy import ecef, geodetic, up
from cloudjax.geometry.shells import chords
from tests.helpers import geostationary_rays


SHELL = Shell(1000.0, 5000.0)
RADIUS = 6.4e6
SPHERE = Ellipsoid(RADIUS, RADIUS)


def _looking(altitude_m: float, elevation_deg: float) -> Rays:
    """One ray over the equator, from an altitude, at an angle above the horizon."""
    θ = np.radians(elevation_deg)
    direction = np.array([[np.sin(θ), np.cos(θ), 0.0]])
    return Rays(np.array([[RADIUS + altitude_m, 0.0, 0.0]]), direction, 1e-4)


def _to_radius(altitude_m: float, elevation_deg: float, radius: float) -> float:
    """Distance outwards to a sphere about the camera."""
    r, μ = RADIUS + altitude_m, np.sin(np.radians(elevation_deg))
    return -r * μ + np.sqrt((r * μ) ** 2 + radius**2 - r**2)


@pytest.mark.parametrize("latitude", [-90.0, -40.0, 0.0, 70.0])
def test_straight_down_the_chord_is_the_thickness(latitude):
    φ, λ = np.array([latitude]), np.array([25.0])
    rays = Rays(ecef(φ, λ, np.array([700e3])), -up(φ, λ), 1e-4)
    chord = chords(rays, SHELL)
    assert chord.length_m[0] == pytest.approx(4000.0, abs=0.01)
    assert chord.entry_m[0] == pytest.approx(695e3, abs=0.01)


def test_chords_begin_and_end_at_the_altitudes_of_the_shell():
    rays = geostationary_rays(50, 30.0)
    chord = chords(rays, SHELL)
    entry = geodetic(rays.at(chord.entry_m))[2]
    leave = geodetic(rays.at(chord.entry_m + chord.length_m))[2]
    np.testing.assert_allclose(entry, 5000, atol=0.02)
    np.testing.assert_allclose(leave, 1000, atol=0.02)


def test_a_limb_ray_crosses_the_whole_shell():
    closest = RADIUS + 3000.0
    rays = Rays(np.array([[closest, -3e7, 0.0]]), np.array([[0.0, 1, 0]]), 1e-4)
    chord = chords(rays, SHELL, SPHERE)
    half = np.sqrt((RADIUS + 5000.0) ** 2 - closest**2)
    assert chord.length_m[0] == pytest.approx(2 * half, rel=1e-9)
    assert chord.entry_m[0] == pytest.approx(3e7 - half, rel=1e-9)


def test_a_ray_below_the_shell_at_its_lowest_has_its_first_chord_only():
    closest = RADIUS + 500.0
    rays = Rays(np.array([[closest, -3e7, 0.0]]), np.array([[0.0, 1, 0]]), 1e-4)
    chord = chords(rays, SHELL, SPHERE)
    outer = np.sqrt((RADIUS + 5000.0) ** 2 - closest**2)
    inner = np.sqrt((RADIUS + 1000.0) ** 2 - closest**2)
    assert chord.length_m[0] == pytest.approx(outer - inner, rel=1e-8)


@pytest.mark.parametrize("elevation", [90.0, 30.0, 5.0, 0.5])
def test_from_the_ground_the_chord_begins_at_the_floor(elevation):
    chord = chords(_looking(0.0, elevation), SHELL, SPHERE)
    start = _to_radius(0.0, elevation, RADIUS + 1000)
    end = _to_radius(0.0, elevation, RADIUS + 5000)
    assert chord.entry_m[0] == pytest.approx(start, abs=1e-3)
    assert chord.length_m[0] == pytest.approx(end - start, abs=1e-3)


@pytest.mark.parametrize(
    ("elevation", "length"),
    [(90.0, 2000.0), (-90.0, 2000.0), (0.0, _to_radius(3000.0, 0.0, RADIUS + 5000))],
)
def test_from_within_the_chord_begins_at_the_camera(elevation, length):
    chord = chords(_looking(3000.0, elevation), SHELL, SPHERE)
    assert chord.entry_m[0] == 0
    assert chord.length_m[0] == pytest.approx(length, rel=1e-6)


@pytest.mark.parametrize(
    ("altitude", "elevation"),
    [(20e3, 90.0), (20e3, 1.0), (500.0, -30.0), (0.0, -90.0), (900e3, 0.0)],
    ids=["up", "level above", "ground in front", "into the ground", "space"],
)
def test_rays_that_miss_have_an_empty_chord(altitude, elevation):
    chord = chords(_looking(altitude, elevation), SHELL, SPHERE)
    assert chord.length_m[0] == 0
    assert np.isfinite(chord.entry_m[0])


def test_every_direction_from_every_height_gives_a_finite_chord():
    rng = np.random.default_rng(2)
    direction = rng.normal(size=(4000, 3))
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    height = rng.choice([0.0, 1.0, 999.9, 1000.0, 3e3, 5000.0, 8e3, 4e5, 3.6e7], 4000)
    origin = ecef(rng.uniform(-90, 90, 4000), rng.uniform(-180, 180, 4000), height)
    chord = chords(Rays(origin, direction, 1e-4), SHELL)
    assert np.isfinite(chord.entry_m).all()
    assert np.isfinite(chord.length_m).all()
    assert np.all(chord.length_m >= 0)
    middle = origin + (chord.entry_m + chord.length_m / 2)[:, None] * direction
    cut = chord.length_m > 1
    altitude = geodetic(middle)[2][cut]
    assert cut.sum() > 1000
    assert np.all((altitude > 0.9e3) & (altitude < 5.1e3))


@pytest.mark.parametrize("altitudes", [(5e3, 1e3), (1e3, 1e3), (-6e2, 1e3), (0.0, 2e5)])
def test_impossible_shells_are_refused(altitudes):
    with pytest.raises(ValueError, match="give a bottom below the top"):
        Shell(*altitudes)
