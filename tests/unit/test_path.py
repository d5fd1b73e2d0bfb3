"""The way through a shell in float32 against float64 positions on the ellipsoid."""

import functools as ft

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import FixedGrid, Rays, Shell
from cloudjax.geometry.geodesy import ecef, geodetic, up
from cloudjax.geometry.path import (
    Path,
    Profile,
    along_chord,
    middles,
    navigate,
    points_along,
)
from cloudjax.geometry.shells import chords
from cloudjax.weather.drift import drift_m, strain
from tests.helpers import TurnedAir, ground_points, rays_to


SHELL = Shell(500.0, 12e3)
STEPS = 16


def _disc() -> Rays:
    angle = np.linspace(-0.1522, 0.1522, 61)
    return FixedGrid(angle, angle, -75.0).rays()


def _low_orbit() -> Rays:
    """From 700 km over 40 N, out to the horizon 3000 km away."""
    camera = ecef(np.array([40.0]), np.array([179.0]), np.array([700e3]))
    return rays_to(camera, ground_points(2000, 40.0, 179.0, 22.0))


def _limb() -> Rays:
    """From 700 km over 40 N, a fan about the horizon in all directions."""
    place = np.array([40.0]), np.array([-100.0])
    down = -up(*place)[0]
    azimuth, angle = np.meshgrid(np.linspace(0, 6.28, 40), np.linspace(1.10, 1.13, 60))
    north = np.cross(down, np.cross([0, 0, 1.0], down))
    north /= np.linalg.norm(north)
    east = np.cross(north, -down)
    level = np.cos(azimuth)[..., None] * north + np.sin(azimuth)[..., None] * east
    direction = np.cos(angle)[..., None] * down + np.sin(angle)[..., None] * level
    camera = ecef(*place, np.array([700e3]))
    direction = direction.reshape(-1, 3)
    return Rays(np.broadcast_to(camera, direction.shape), direction, 1e-4)


@ft.cache
def _errors(view):
    """Errors of altitude [m] and of the vertical [rad] along chords of a length."""
    rays = view()
    chord = chords(rays, SHELL)
    keep = chord.length_m > 0
    rays, chord = rays[keep], chords(rays[keep], SHELL)
    path = navigate(rays, chord)
    distance = path.distance_m(STEPS)
    assert distance.dtype == jnp.float32
    along = chord.length_m[:, None] * (np.arange(STEPS) + 0.5) / STEPS
    place = (
        rays.origin_m[:, None]
        + (chord.entry_m[:, None] + along)[..., None] * (rays.direction[:, None])
    )
    latitude, longitude, altitude = geodetic(place)
    normal = np.moveaxis(up(latitude, longitude), -1, 0)
    tilt = np.linalg.norm(path.up(distance) - normal, axis=0)
    off = np.abs(path.altitude_m(distance) - altitude)
    return chord.length_m, off.max(-1), tilt.max(-1)


@pytest.mark.parametrize(
    ("view", "longest", "metres", "radians"),
    [
        (_disc, 50e3, 0.01, 2e-5),
        (_disc, np.inf, 0.5, 6e-5),
        (_low_orbit, 50e3, 0.015, 4e-5),
        (_low_orbit, np.inf, 1.3, 3e-4),
        (_limb, 200e3, 0.5, 2e-4),
        (_limb, np.inf, 20.0, 6e-4),
    ],
    ids=["disc", "disc edge", "low orbit", "horizon", "near the limb", "limb"],
)
def test_altitudes_and_verticals_hold_in_single_precision(
    view, longest, metres, radians
):
    """Chords from straight down to the limb through a shell of 12 km.

    Expectation: the geodetic altitude and normal of the float64 position. Measured in
    metres: 0.004 and 0.007 on chords below 50 km from geostationary and low orbit, 0.25
    and 0.65 on those that reach the ground, 12.7 on limb chords of 760 km, where the
    ellipsoid's curvature changes along the chord. Tolerance: twice that or less.
    """
    length, altitude, tilt = _errors(view)
    assert np.count_nonzero(length < longest) > 30
    assert altitude[length < longest].max() < metres
    assert tilt[length < longest].max() < radians


def test_distances_are_the_middles_of_equal_steps():
    path = navigate(_disc()[1830:1832], chords(_disc()[1830:1832], SHELL))
    distance = np.asarray(path.distance_m(4))
    expected = np.asarray(path.length_m)[:, None] * np.array([1, 3, 5, 7]) / 8
    np.testing.assert_allclose(distance, expected, rtol=1e-6)


def test_rays_that_miss_are_finite():
    direction = np.array([[0.0, 1, 0], [1, 0, 0]])
    rays = Rays(np.array([[4.2e7, 0, 0]] * 2), direction, 1e-4)
    path = navigate(rays, chords(rays, SHELL))
    distance = path.distance_m(3)
    for leaf in jax.tree.leaves((path, path.altitude_m(distance), path.up(distance))):
        assert jnp.isfinite(leaf).all()
    np.testing.assert_array_equal(path.length_m, 0)


def test_the_path_takes_the_precision_of_the_running_jax():
    rays = _disc()[1830:1832]
    with jax.enable_x64(True):
        path = navigate(rays, chords(rays, SHELL))
        assert path.length_m.dtype == jnp.float64
    assert isinstance(path, Path)


def test_points_along_a_chord_run_from_its_entry_to_its_exit():
    rays = _disc()[1830:1832]
    chord = chords(rays, SHELL)
    points = points_along(rays, chord, 3)
    assert len(points) == 3
    for fraction, point in zip((0, 0.5, 1), points, strict=True):
        expected = rays.at(chord.entry_m + fraction * chord.length_m)
        np.testing.assert_allclose(point, expected, atol=1e-6)


@pytest.mark.parametrize("knots", [2, 3, 5])
def test_between_knots_values_are_linear(knots):
    """Straight through all knots of a line, and on the broken line through others."""
    at = np.linspace(0, 1, knots)
    there = middles(7)
    values = np.stack([at, at**2], axis=1)
    found = along_chord(jnp.asarray(values[..., None], float), there)
    np.testing.assert_allclose(found[0], there, atol=1e-6)
    np.testing.assert_allclose(found[1], np.interp(there, at, at**2), atol=1e-6)


@pytest.mark.parametrize(("x64", "metres"), [(True, 1e-6), (False, 2.0)])
def test_air_drifts_at_its_altitude(x64, metres):
    """3000 km and more: float32 loses a part in ten million."""
    latitude, longitude = np.array([10.0, -60, 90]), np.array([5.0, -170, 0])
    altitude = np.array([1e3, 8e3, 3e3])
    here = ecef(latitude, longitude, altitude)
    with jax.enable_x64(x64):
        vertical = jnp.asarray(up(latitude, longitude), float)
        found = drift_m(vertical, jnp.asarray(altitude, float), TurnedAir.by(30.0))
    expected = ecef(latitude, longitude - 30, altitude) - here
    np.testing.assert_allclose(found, expected, atol=metres)


def test_solid_air_is_turned_and_not_strained():
    """∂x'/∂x is the rotation itself; on the ellipsoid off by twice the flattening."""
    air = TurnedAir.by(30.0)
    turn = np.eye(3) + np.asarray(air.displacement_of(jnp.eye(3))).T
    vertical = up(np.array([0.0, 50.0, -80.0]), np.array([0.0, 100.0, -20.0]))
    found = strain(jnp.asarray(vertical, float), air)
    np.testing.assert_allclose(found, np.broadcast_to(turn, (3, 3, 3)), atol=4e-3)


@pytest.mark.parametrize("ends", [True, False])
def test_a_straight_profile_is_straight_in_steps_and_anywhere(ends):
    """Held at 5 points, taken in 8 steps and at parts of the chord."""
    at = np.linspace(0, 1, 5) if ends else middles(5)
    profile = Profile(jnp.asarray(3 * at[None] - 1, float), ends)
    inner = slice(None) if ends else slice(1, -1)
    steps = profile.in_steps(8)[0, inner]
    np.testing.assert_allclose(steps, 3 * middles(8)[inner] - 1, atol=1e-6)
    parts = jnp.asarray([[0.2, 0.5, 0.77]])
    np.testing.assert_allclose(profile.at(parts), 3 * parts - 1, atol=1e-6)


def test_a_profile_in_its_own_steps_is_itself():
    profile = Profile(jnp.asarray([[1.0, 4.0, 2.0]]))
    assert profile.in_steps(3) is profile.values
    np.testing.assert_allclose(profile.at(jnp.asarray([[0.0, 1.0]])), [[1.0, 2.0]])


def _altitudes(path: Path, distance) -> np.ndarray:
    return np.asarray(path.altitude_m(distance[:, None])[:, 0])


@pytest.mark.parametrize("upwards", [False, True], ids=["from above", "from below"])
def test_a_path_between_altitudes_begins_and_ends_at_them(upwards):
    rays = _disc()
    chord = chords(rays, SHELL)
    path = navigate(rays, chord)
    turn = -np.asarray(path.radius_m * (path.direction * path.entry_up).sum(-1))
    keep = (chord.length_m > 0) & (turn > chord.length_m)
    path = jax.tree.map(lambda x: x[keep], path)
    if upwards:
        end = path.length_m[:, None]
        path = Path(
            path.length_m,
            path.altitude_m(end)[:, 0],
            path.radius_m + path.altitude_m(end)[:, 0] - path.entry_altitude_m,
            -path.direction,
            path.up(end)[..., 0].T,
        )
    rays = jnp.ones_like(path.length_m)
    first, last = path.between(2e3 * rays, 5e3 * rays)
    passed = np.sort([_altitudes(path, first), _altitudes(path, last)], axis=0)
    assert passed.shape[1] > 1000
    assert np.abs(passed - [[2e3], [5e3]]).max() < 1.0
    part = path.part(first, last)
    assert np.abs(part.length_m - (last - first)).max() < 0.1
    middle = (first + last) / 2
    there = _altitudes(part, part.length_m / 2)
    assert np.abs(there - _altitudes(path, middle)).max() < 1.0


def test_a_path_that_turns_is_between_altitudes_from_one_side_to_the_other():
    rays = _limb()
    chord = chords(rays, SHELL)
    path = navigate(rays, chord)
    turn = -np.asarray(path.radius_m * (path.direction * path.entry_up).sum(-1))
    lowest = _altitudes(path, jnp.asarray(turn, jnp.float32))
    keep = (turn > 0) & (turn < chord.length_m) & (lowest < 3e3)
    path, turn = jax.tree.map(lambda x: x[keep], (path, turn))
    assert keep.sum() > 50
    rays = jnp.ones_like(path.length_m)
    first, last = path.between(1e3 * rays, 5e3 * rays)
    for end in first, last:
        assert np.abs(_altitudes(path, end) - 5e3).max() < 5.0
    assert np.abs((first + last) / 2 - turn).max() < 100.0


def test_a_path_between_altitudes_out_of_its_shell_is_empty():
    rays = _disc()
    chord = chords(rays, SHELL)
    path = navigate(rays, chord)
    turn = -np.asarray(path.radius_m * (path.direction * path.entry_up).sum(-1))
    path = jax.tree.map(lambda x: x[turn > chord.length_m], path)
    one = jnp.ones_like(path.length_m)
    first, last = path.between(13e3 * one, 14e3 * one)
    assert np.abs(last - first).max() == 0
