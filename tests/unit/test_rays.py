"""Lines of sight: positions, ground points and footprints."""

import numpy as np
import pytest

from cloudjax import FixedGrid, Rays
from cloudjax.geometry.geodesy import GRS80, ecef
from tests.helpers import GEOSTATIONARY_M, rays_to


@pytest.fixture
def three() -> Rays:
    """From geostationary distance: straight down, away from the Earth, past it."""
    direction = np.array([[-1.0, 0, 0], [1, 0, 0], [-0.8, 0.6, 0]])
    return Rays(np.array([GEOSTATIONARY_M] * 3), direction, 1e-4)


def test_rays_can_be_counted_chosen_and_walked(three):
    assert len(three) == 3
    last = three[1:]
    assert len(last) == 2
    assert last.pixel_rad == three.pixel_rad
    np.testing.assert_array_equal(last.direction, three.direction[1:])
    walked = three.at(np.array([1e3, 2e3, 5e3])) - GEOSTATIONARY_M
    np.testing.assert_allclose(walked, [[-1e3, 0, 0], [2e3, 0, 0], [-4e3, 3e3, 0]])


def test_only_rays_that_meet_the_earth_ahead_have_ground(three):
    ground, hit = three.ground()
    assert hit.tolist() == [True, False, False]
    assert ground.distance_m[0] == pytest.approx(42164160.0 - GRS80.semi_major_m)
    assert ground.latitude_deg[0] == pytest.approx(0)
    assert np.isfinite(ground.latitude_deg).all()
    assert np.isfinite(ground.longitude_deg).all()


def test_footprints_straight_down_and_off_the_earth(three):
    width = three.footprint_m()
    assert width[0] == pytest.approx(1e-4 * (42164160.0 - GRS80.semi_major_m))
    assert np.isnan(width[1:]).all()


@pytest.mark.parametrize("zenith_deg", [0.0, 30.0, 60.0, 75.0])
def test_a_slanted_pixel_is_stretched_by_its_secant(zenith_deg):
    """The root of the area, so the root of the secant."""
    θ = np.radians(zenith_deg)
    place = ecef(np.zeros(1), np.zeros(1), np.zeros(1))
    camera = place + 800e3 * np.array([[np.cos(θ), np.sin(θ), 0]])
    width = rays_to(camera, place, pixel_rad=1e-3).footprint_m()
    assert width[0] == pytest.approx(800.0 / np.sqrt(np.cos(θ)), rel=1e-9)


def test_footprints_fill_the_ground_between_pixels():
    """The area between neighbouring pixels of the fixed grid, within 1 %."""
    angle = np.arange(-3, 4) * 56e-6 + 0.09
    grid = FixedGrid(angle, angle, -75.0)
    rays = grid.rays()
    ground, _ = rays.ground()
    place = rays.at(ground.distance_m).reshape(7, 7, 3)
    across, along = place[3, 4] - place[3, 2], place[4, 3] - place[2, 3]
    area = np.linalg.norm(np.cross(across, along)) / 4
    assert rays.footprint_m()[24] == pytest.approx(np.sqrt(area), rel=0.01)
