"""Pixels as Gaussians on the level surface, and rays of one kind."""

import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import Rays, Shell
from cloudjax.geometry.footprint import (
    Footprint,
    Sampling,
    grouped,
    kind_of,
    kinds,
    stretch_of,
)
from cloudjax.geometry.geodesy import ecef, up
from tests.helpers import GEOSTATIONARY_M, geostationary_rays, limb_rays, rays_to


AIR = Shell(500.0, 12e3)


def _kinds_of(rays: Rays):
    return [kind_of(row) for row in kinds(rays, AIR)]


def _to(latitude, longitude, pixel_rad=5.6e-5) -> Rays:
    place = np.array([latitude], float), np.array([longitude], float)
    target = ecef(*place, np.array([6e3]))
    return rays_to(GEOSTATIONARY_M, target, pixel_rad)


def test_a_pixel_has_the_variances_of_a_box():
    """0.64 of width²/12; along the view as much longer as the ray is slant."""
    pixel = Footprint.level(jnp.asarray([300.0]), stretch_of(jnp.asarray([-1 / 3])))
    np.testing.assert_allclose(pixel.across_m, 0.8 * 300 / np.sqrt(12))
    np.testing.assert_allclose(pixel.along_m, 0.8 * 900 / np.sqrt(12), rtol=1e-6)


def test_a_step_that_is_longer_than_the_pixel_averages_as_well():
    narrow, wide = (
        Footprint.level(jnp.asarray([width]), jnp.ones(1), step_m=100.0)
        for width in (10.0, 1e4)
    )
    assert float(narrow.along_m[0]) == pytest.approx(0.8 * 100 / np.sqrt(12), rel=0.01)
    assert float(wide.along_m[0]) == pytest.approx(float(wide.across_m[0]), rel=1e-3)


def test_at_the_limb_a_pixel_ends():
    np.testing.assert_allclose(stretch_of(jnp.asarray([0.0, 1e-3, 0.5])), [6, 6, 2])


@pytest.mark.parametrize(
    ("latitude", "longitude"), [(0, 0), (20, 10), (-45, 30), (0, 60), (10, -72)]
)
def test_a_kind_holds_what_the_pixel_is(latitude, longitude):
    """No wider than twice the least width, no longer than the greatest stretch."""
    rays = _to(latitude, longitude)
    (kind,) = _kinds_of(rays)
    vertical = up(np.array([latitude], float), np.array([longitude], float))[0]
    width = 5.6e-5 * float(rays.ground()[0].distance_m[0])
    stretch = -1 / (vertical @ rays.direction[0])
    assert kind.finest_m < 1.001 * width < 2.002 * kind.finest_m
    if stretch > 6:
        assert kind.stretch == np.inf
    else:
        assert stretch < 1.05 * kind.stretch < 2.1 * stretch + 0.1


@pytest.mark.parametrize("pixel_rad", [1.4e-5, 2.8e-5, 5.6e-5, 28e-5])
def test_the_usual_pixels_from_geostationary_orbit_are_as_wide_as_each_other(pixel_rad):
    kinds_of = [_kinds_of(_to(0, longitude, pixel_rad))[0] for longitude in (0, 40, 74)]
    assert len({kind.finest_m for kind in kinds_of}) == 1


@pytest.mark.parametrize(
    ("stretch", "depth_m", "knots"),
    [(8.0, 7e3, 2), (8.0, 8e3, 9), (np.inf, 10.0, 9)],
    ids=["short", "long", "at the limb"],
)
def test_a_way_of_less_than_60_km_has_two_knots(stretch, depth_m, knots):
    assert Sampling(2e3, stretch, knots=9).through(depth_m).knots == knots


def test_kinds_do_not_depend_on_the_other_rays():
    rays = geostationary_rays(50, 60.0)
    whole = kinds(rays, AIR)
    parts = np.concatenate([kinds(rays[:20], AIR), kinds(rays[20:], AIR)])
    np.testing.assert_array_equal(whole, parts)
    assert len(np.unique(whole, axis=0)) > 2


def test_half_the_pixel_is_a_kind_down():
    fine, coarse = kinds(_to(0, 0, 1e-5), AIR), kinds(_to(0, 0, 2e-5), AIR)
    assert coarse[0, 0] - fine[0, 0] == 1
    np.testing.assert_array_equal(fine[0, 1:], coarse[0, 1:])


def test_groups_are_of_one_kind_each_and_hold_every_ray():
    rows = kinds(geostationary_rays(300, 70.0), AIR)
    found = list(grouped(rows))
    assert len(found) > 2
    for kind, members in found:
        assert {kind_of(row) for row in rows[members]} == {kind}
    every = np.sort(np.concatenate([members for _, members in found]))
    np.testing.assert_array_equal(every, np.arange(300))


def test_grazing_rays_have_more_knots_and_cross_twice():
    steep, grazing = _kinds_of(_to(0, 0))[0], _kinds_of(limb_rays(3000.0))[0]
    assert (steep.knots, steep.twice) == (2, False)
    assert grazing.knots > 2
    assert not grazing.twice
    below = kind_of(kinds(limb_rays(200.0), AIR)[0])
    assert below.twice
    assert below.stretch > 4


def test_a_layer_is_crossed_twice_by_rays_that_never_leave_the_air_of_all():
    """A ray that passes at 2 km, in a lower layer, crosses a higher one twice."""
    air, low, high = Shell(1e3, 7e3), Shell(1e3, 2200.0), Shell(5e3, 7e3)
    rays = limb_rays(500.0, 2e3, 3e3, 6e3, 1e5)
    assert kinds(rays, air)[:, 3].tolist() == [1, 0, 0, 0, 0]
    assert kinds(rays, air, (low, high))[:, 3].tolist() == [1, 1, 1, 0, 0]
    steep = _to(0, 0)
    np.testing.assert_array_equal(kinds(steep, air, (low, high)), kinds(steep, air))


@pytest.mark.parametrize("latitude", [90.0, -90.0])
def test_kinds_are_finite_at_the_poles_and_off_the_earth(latitude):
    place = np.array([latitude]), np.array([0.0])
    down = Rays(ecef(*place, np.array([8e5])), -up(*place), 1e-4)
    away = Rays(ecef(*place, np.array([8e5])), up(*place), 1e-4)
    for rays in (down, away):
        (kind,) = _kinds_of(rays)
        assert 0 < kind.finest_m < 1e9
        assert 1 <= kind.stretch <= 8
