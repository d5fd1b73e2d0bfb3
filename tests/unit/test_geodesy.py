"""The ellipsoid against pyproj and against closed formulas."""

import numpy as np
import pyproj
import pytest

from cloudjax.geometry.geodesy import (
    GRS80,
    curvature_radius,
    ecef,
    geodetic,
    intersect,
    up,
)


CARTESIAN = pyproj.Transformer.from_pipeline("+proj=cart +ellps=GRS80")


@pytest.fixture
def places():
    """Latitude, longitude, altitude from the ground to geostationary distance."""
    rng = np.random.default_rng(0)
    latitude = np.concatenate([rng.uniform(-90, 90, 500), [-90, 90, 0, 0, 45]])
    longitude = np.concatenate([rng.uniform(-180, 180, 500), [0, 0, 180, -90, 180]])
    altitude = 10 ** rng.uniform(0, 7.56, 505) - 501
    return latitude, longitude, altitude


def test_ecef_positions_equal_those_of_pyproj(places):
    latitude, longitude, altitude = places
    expected = np.stack(CARTESIAN.transform(longitude, latitude, altitude), -1)
    # GRS80 gives its polar axis to 3e-6 m.
    np.testing.assert_allclose(ecef(*places), expected, rtol=0, atol=3e-6)


def test_geodetic_positions_come_back_from_ecef_within_a_micrometre(places):
    latitude, longitude, altitude = geodetic(ecef(*places))
    metres = np.radians(GRS80.semi_major_m)  # per degree
    np.testing.assert_allclose(latitude, places[0], rtol=0, atol=1e-6 / metres)
    turn = (longitude - places[1] + 180) % 360 - 180
    assert np.all(np.abs(turn) * np.cos(np.radians(places[0])) * metres < 1e-6)
    np.testing.assert_allclose(altitude, places[2], rtol=0, atol=1e-6)


def test_geodetic_positions_equal_those_of_pyproj(places):
    low = places[2] < 20e3  # pyproj does not iterate and is not exact far above
    position = ecef(*places)[low]
    longitude, latitude, altitude = CARTESIAN.transform(
        position[:, 0], position[:, 1], position[:, 2], direction="INVERSE"
    )
    found = geodetic(position)
    np.testing.assert_allclose(found[0], latitude, rtol=0, atol=1e-10)
    np.testing.assert_allclose(found[2], altitude, rtol=0, atol=1e-5)
    np.testing.assert_allclose(
        up(*found[:2]), up(latitude, longitude), rtol=0, atol=1e-12
    )


def test_the_poles_have_altitudes_of_their_own():
    pole = np.array([[0.0, 0.0, GRS80.semi_minor_m + 5.0], [0.0, 0.0, -7e6]])
    latitude, _, altitude = geodetic(pole)
    np.testing.assert_allclose(latitude, [90, -90], atol=1e-12)
    np.testing.assert_allclose(altitude, [5.0, 7e6 - GRS80.semi_minor_m], atol=1e-8)


@pytest.mark.parametrize("altitude", [1e3, 1e4, 1e5])
def test_a_raised_ellipsoid_is_everywhere_at_its_altitude(altitude):
    """Measured: an eighth of the flattening squared, 14 cm at 100 km."""
    latitude = np.linspace(-90, 90, 721)
    zero = np.zeros_like(latitude)
    surface = ecef(latitude, zero, zero, GRS80.raised(altitude))
    error = np.abs(geodetic(surface)[2] - altitude).max()
    flattening = 1 - GRS80.semi_minor_m / GRS80.semi_major_m
    assert error < 0.13 * flattening**2 * altitude


def _compass(latitude, longitude, azimuth):
    """Horizontal unit vectors by azimuth from north."""
    φ, λ, α = np.radians(latitude), np.radians(longitude), np.radians(azimuth)
    north = np.stack([-np.sin(φ) * np.cos(λ), -np.sin(φ) * np.sin(λ), np.cos(φ)], -1)
    east = np.stack([-np.sin(λ), np.cos(λ), 0 * λ], -1)
    return np.cos(α)[:, None] * north + np.sin(α)[:, None] * east


def _main_radii(latitude):
    """The closed formulas of the meridian and the prime-vertical radius."""
    a, b = GRS80.semi_major_m, GRS80.semi_minor_m
    φ = np.radians(latitude)
    root = np.hypot(a * np.cos(φ), b * np.sin(φ))
    return (a * b) ** 2 / root**3, a**2 / root


@pytest.mark.parametrize("slant_deg", [0.0, 30.0, 89.0])
def test_curvature_radii_follow_euler(slant_deg):
    latitude = np.repeat([-80.0, -30.0, 0.0, 10.0, 45.0, 89.0], 5)
    longitude = np.linspace(-180, 180, latitude.size)
    azimuth = np.tile([0.0, 30.0, 90.0, 135.0, 180.0], 6)
    normal = up(latitude, longitude)
    slant = np.radians(slant_deg)
    level = _compass(latitude, longitude, azimuth)
    direction = np.cos(slant) * level - np.sin(slant) * normal
    meridian, prime = _main_radii(latitude)
    sin2 = np.sin(np.radians(azimuth)) ** 2
    expected = 1 / ((1 - sin2) / meridian + sin2 / prime)
    np.testing.assert_allclose(curvature_radius(normal, direction), expected, rtol=1e-9)


def test_curvature_radii_are_those_of_the_surface_itself():
    """A level line of sight gains s²/2R of altitude over a short distance s."""
    latitude, longitude = np.full(8, 37.0), np.full(8, -20.0)
    azimuth = np.linspace(0, 180, 8)
    direction = _compass(latitude, longitude, azimuth)
    start = ecef(latitude, longitude, np.zeros(8))
    s = 2000.0
    # The mean of both ways has no odd terms.
    gained = sum(geodetic(start + way * direction)[2] for way in (-s, s)) / 2
    radius = curvature_radius(up(latitude, longitude), direction)
    np.testing.assert_allclose(s**2 / 2 / gained, radius, rtol=1e-6)


def test_curvature_radii_at_the_poles_and_straight_down():
    pole = np.array([[0.0, 0.0, 1.0]] * 3)
    ways = np.array([[1.0, 0, 0], [0.6, 0.8, 0], [0, 0, -1]])
    polar = GRS80.semi_major_m**2 / GRS80.semi_minor_m
    np.testing.assert_allclose(curvature_radius(pole, ways), polar, rtol=1e-9)
    equator = np.array([[1.0, 0.0, 0.0]])
    down = curvature_radius(equator, -equator)
    meridian, prime = _main_radii(np.zeros(1))
    np.testing.assert_allclose(down, 2 / (1 / meridian + 1 / prime), rtol=1e-12)


def test_lines_meet_the_ellipsoid_where_its_equation_holds():
    rng = np.random.default_rng(1)
    target = rng.normal(size=(300, 3)) * 3e6
    origin = np.array([42164160.0, 0, 0]) + 0 * target
    direction = target - origin
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    near, far, hit = intersect(origin, direction)
    assert 100 < hit.sum() <= 300
    axes = np.array([GRS80.semi_major_m] * 2 + [GRS80.semi_minor_m])
    for distance in (near, far):
        ends = (origin + distance[:, None] * direction)[hit] / axes
        np.testing.assert_allclose((ends**2).sum(-1), 1, rtol=0, atol=1e-14)
    assert np.all(near[hit] < far[hit])


def test_lines_that_miss_have_an_empty_chord_at_their_closest_point():
    origin = np.array([[42164160.0, 0, 0]])
    direction = np.array([[-1.0, 0.3, 0.0]]) / np.hypot(1, 0.3)
    near, far, hit = intersect(origin, direction)
    assert not hit[0]
    assert near[0] == far[0] == pytest.approx(-(origin * direction).sum())


def test_tangents_have_an_empty_chord():
    a = GRS80.semi_major_m
    origin = np.array([[a * (1 + 1e-12), -1e7, 0], [a * (1 - 1e-9), -1e7, 0]])
    direction = np.array([[0.0, 1, 0]] * 2)
    near, far, hit = intersect(origin, direction)
    assert hit.tolist() == [False, True]
    assert far[0] - near[0] == 0
    assert far[1] - near[1] == pytest.approx(2 * a * np.sqrt(2e-9), rel=1e-5)


def test_from_inside_one_end_lies_behind():
    near, far, hit = intersect(np.zeros((2, 3)), np.eye(3)[[0, 2]])
    axes = [GRS80.semi_major_m, GRS80.semi_minor_m]
    assert hit.all()
    np.testing.assert_allclose(far, axes, rtol=1e-15)
    np.testing.assert_allclose(near, -far, rtol=1e-15)
