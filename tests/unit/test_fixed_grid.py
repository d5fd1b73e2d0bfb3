"""The fixed grid of the imager against its user's guide and against pyproj."""

import numpy as np
import pyproj
import pytest

from cloudjax import FixedGrid


HEIGHT_M = 35786023.0


def _grid(x, y, **others) -> FixedGrid:
    return FixedGrid(np.asarray(x), np.asarray(y), -75.0, **others)


def test_the_worked_example_of_the_users_guide():
    """GOES-R PUG volume 3, section 5.1.2.8: printed to six decimals of a degree."""
    grid = _grid([-0.024052, 0.0], [0.095340])
    ground, hit = grid.rays().ground()
    assert hit.all()
    assert ground.latitude_deg[0] == pytest.approx(33.846162, abs=1e-6)
    assert ground.longitude_deg[0] == pytest.approx(-84.690932, abs=1e-6)
    assert ground.distance_m[0] == pytest.approx(37116295.87, abs=0.01)


@pytest.mark.parametrize("sweep", ["x", "y"])
def test_the_full_disc_lies_where_pyproj_puts_it(sweep):
    angle = np.linspace(-0.151, 0.151, 61)
    ground, hit = _grid(angle, angle, sweep=sweep).rays().ground()
    geos = pyproj.Proj(proj="geos", h=HEIGHT_M, lon_0=-75, sweep=sweep, ellps="GRS80")
    y, x = np.meshgrid(angle * HEIGHT_M, angle * HEIGHT_M, indexing="ij")
    longitude, latitude = (c.ravel() for c in geos(x, y, inverse=True))
    np.testing.assert_array_equal(hit, np.isfinite(longitude) & (longitude < 1e29))
    assert 2500 < hit.sum() < 3721
    turn = (ground.longitude_deg[hit] - longitude[hit] + 180) % 360 - 180
    np.testing.assert_allclose(ground.latitude_deg[hit], latitude[hit], atol=1e-6)
    np.testing.assert_allclose(turn, 0, atol=1e-6)


def test_the_sweep_matters_off_the_axes():
    places = []
    for sweep in ("x", "y"):
        ground, _ = _grid([0.1, 0.2], [0.1], sweep=sweep).rays().ground()
        places.append(ground.latitude_deg[0])
    assert abs(places[0] - places[1]) > 0.1


def test_rays_run_row_by_row_and_know_their_pixel():
    grid = _grid([-2e-3, -1e-3, 1e-3], [0.02, 0.01])
    rays = grid.rays()
    assert grid.shape == (2, 3)
    assert len(rays) == 6
    assert rays.pixel_rad == pytest.approx(1e-3)
    np.testing.assert_allclose(np.linalg.norm(rays.direction, axis=-1), 1, rtol=1e-15)
    ground, _ = rays.ground()
    rows = ground.latitude_deg.reshape(grid.shape)
    assert np.all(rows[0] > rows[1])
    assert np.all(np.diff(ground.longitude_deg.reshape(grid.shape), axis=1) > 0)


def test_packed_angles_are_navigated_in_double_precision():
    x = np.array([0.0, 0.1], np.float32)
    fine = _grid(x.astype(float), x.astype(float)).rays().direction
    packed = FixedGrid(x, x, -75.0).rays().direction
    assert packed.dtype == np.float64
    np.testing.assert_array_equal(packed, fine)


def test_the_satellite_stands_over_the_equator_at_its_longitude():
    satellite = _grid([0.0, 1.0], [0.0]).satellite_m
    assert np.linalg.norm(satellite) == pytest.approx(42164160.0, abs=1e-6)
    assert np.degrees(np.arctan2(satellite[1], satellite[0])) == pytest.approx(-75)
    assert satellite[2] == 0
