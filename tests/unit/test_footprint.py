"""Kinds of pixels: a fixed grid of ellipses on the level surface."""

import numpy as np
import pytest

from cloudjax import Footprint, Rays, Shell
from cloudjax.geometry.footprint import POINT, kind_of, kinds
from cloudjax.geometry.geodesy import ecef, up
from tests.helpers import GEOSTATIONARY_M, geostationary_rays, limb_rays, rays_to


AIR = Shell(500.0, 12e3)


def _kinds_of(rays: Rays):
    return [kind_of(row) for row in kinds(rays, AIR)]


def _to(latitude, longitude, pixel_rad=5.6e-5) -> Rays:
    place = np.array([latitude], float), np.array([longitude], float)
    target = ecef(*place, np.array([6e3]))
    return rays_to(GEOSTATIONARY_M, target, pixel_rad)


def test_the_covariance_is_that_of_a_box():
    level = Footprint(300.0, 900.0, along=(0.0, 0.6, 0.8))
    values, vectors = np.linalg.eigh(level.covariance_m2)
    np.testing.assert_allclose(values, 0.64 * np.array([300, 300, 900]) ** 2 / 12)
    assert abs(vectors[:, 2] @ level.along) == pytest.approx(1)
    np.testing.assert_array_equal(POINT.covariance_m2, 0)


@pytest.mark.parametrize("slant", [1.0, 0.5, 0.05])
def test_the_view_has_the_slant(slant):
    level = Footprint(1.0, 1.0 / slant, along=(0.0, -0.8, 0.6))
    assert level.slant == pytest.approx(slant)
    assert np.linalg.norm(level.view) == pytest.approx(1)
    assert abs(level.view @ level.along) == pytest.approx(np.sqrt(1 - slant**2))


@pytest.mark.parametrize(
    ("latitude", "longitude"), [(0, 0), (20, 10), (-45, 30), (0, 60), (10, -72)]
)
def test_a_kind_is_near_what_the_pixel_is(latitude, longitude):
    """Widths within √√2, stretch within √2, directions within 36°."""
    rays = _to(latitude, longitude)
    footprint = _kinds_of(rays)[0].footprint
    vertical = up(np.array([latitude], float), np.array([longitude], float))[0]
    width = 5.6e-5 * float(rays.ground()[0].distance_m[0])
    slant = -vertical @ rays.direction[0]
    assert abs(np.log2(footprint.width_m / width)) < 0.26
    stretch = footprint.length_m / footprint.width_m
    assert stretch == pytest.approx(1 / footprint.slant)
    assert abs(np.log2(stretch * slant)) < 0.51
    if stretch > 1.3:
        level = rays.direction[0] + slant * vertical
        heading = abs(level @ footprint.along) / np.linalg.norm(level)
        assert heading > np.cos(np.radians(36))
    else:
        assert footprint.length_m == footprint.width_m


def test_kinds_do_not_depend_on_the_other_rays():
    rays = geostationary_rays(50, 60.0)
    whole = kinds(rays, AIR)
    parts = np.concatenate([kinds(rays[:20], AIR), kinds(rays[20:], AIR)])
    np.testing.assert_array_equal(whole, parts)
    assert len(np.unique(whole, axis=0)) > 5


def test_half_the_pixel_is_two_rungs_down():
    fine, coarse = kinds(_to(0, 0, 1e-5), AIR), kinds(_to(0, 0, 2e-5), AIR)
    assert coarse[0, 0] - fine[0, 0] == 2
    np.testing.assert_array_equal(fine[0, 1:], coarse[0, 1:])


def test_grazing_rays_have_more_knots_and_cross_twice():
    steep, grazing = _kinds_of(_to(0, 0))[0], _kinds_of(limb_rays(3000.0))[0]
    assert (steep.knots, steep.twice) == (2, False)
    assert grazing.knots > 2
    assert not grazing.twice
    below = kind_of(kinds(limb_rays(200.0), AIR)[0])
    assert below.twice
    assert below.footprint.length_m > 4 * below.footprint.width_m


def test_a_layer_is_crossed_twice_by_rays_that_never_leave_the_air_of_all():
    """A ray that passes at 2 km, in a lower layer, crosses a higher one twice."""
    air, low, high = Shell(1e3, 7e3), Shell(1e3, 2200.0), Shell(5e3, 7e3)
    rays = limb_rays(500.0, 2e3, 3e3, 6e3, 1e5)
    assert kinds(rays, air)[:, 6].tolist() == [1, 0, 0, 0, 0]
    assert kinds(rays, air, (low, high))[:, 6].tolist() == [1, 1, 1, 0, 0]
    steep = _to(0, 0)
    np.testing.assert_array_equal(kinds(steep, air, (low, high)), kinds(steep, air))


@pytest.mark.parametrize("latitude", [90.0, -90.0])
def test_kinds_are_finite_at_the_poles_and_off_the_earth(latitude):
    place = np.array([latitude]), np.array([0.0])
    down = Rays(ecef(*place, np.array([8e5])), -up(*place), 1e-4)
    away = Rays(ecef(*place, np.array([8e5])), up(*place), 1e-4)
    for rays in (down, away):
        footprint = _kinds_of(rays)[0].footprint
        assert np.isfinite(footprint.covariance_m2).all()
        assert footprint.width_m > 0
