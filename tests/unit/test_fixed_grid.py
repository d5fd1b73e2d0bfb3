"""The fixed grid of the imager against its user's guide and against pyproj."""

from dataclasses import replace

import numpy as np
import pyproj
import pytest

from cloudjax import Ellipsoid, FixedGrid
from tests.generated import window


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
    grid = _grid(angle, angle, sweep=sweep)
    ground, hit = grid.rays().ground()
    np.testing.assert_array_equal(grid.sees_the_earth().ravel(), hit)
    geos = pyproj.Proj(proj="geos", h=HEIGHT_M, lon_0=-75, sweep=sweep, ellps="GRS80")
    y, x = np.meshgrid(angle * HEIGHT_M, angle * HEIGHT_M, indexing="ij")
    longitude, latitude = (c.ravel() for c in geos(x, y, inverse=True))
    np.testing.assert_array_equal(hit, np.isfinite(longitude) & (longitude < 1e29))
    assert 2500 < hit.sum() < 3721
    turn = (ground.longitude_deg[hit] - longitude[hit] + 180) % 360 - 180
    np.testing.assert_allclose(ground.latitude_deg[hit], latitude[hit], atol=1e-6)
    np.testing.assert_allclose(turn, 0, atol=1e-6)


@pytest.mark.parametrize("sweep", ["x", "y"])
def test_the_earth_ends_where_the_rays_leave_it(sweep):
    """Across the limb off the axes, to 0.1 microradians."""
    grid = _grid([0.1062], np.arange(0.105, 0.109, 1e-7), sweep=sweep)
    _, hit = grid.rays().ground()
    assert 0.05 < hit.mean() < 0.95
    np.testing.assert_array_equal(grid.sees_the_earth().ravel(), hit)


def test_the_sweep_matters_off_the_axes():
    places = []
    for sweep in ("x", "y"):
        ground, _ = _grid([0.1, 0.2], [0.1], sweep=sweep).rays().ground()
        places.append(ground.latitude_deg[0])
    assert abs(places[0] - places[1]) > 0.1


def test_rays_run_row_by_row_and_know_their_pixel():
    grid = _grid([-1e-3, 0.0, 1e-3], [0.02, 0.01])
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


def test_resolutions_nest():
    coarse, fine = window((3, 5), 5.6e-5), window((12, 20), 1.4e-5)
    assert fine.coarsened(4).same_as(coarse)
    assert not fine.coarsened(2).same_as(coarse)
    shifted = replace(coarse, x_rad=coarse.x_rad + 2e-7)
    assert not shifted.same_as(coarse)
    for other in (
        {"subsatellite_longitude_deg": -75.0},
        {"perspective_height_m": 35785863.0},
        {"ellipsoid": Ellipsoid(6378137.0, 6356752.3)},
        {"sweep": "y"},
    ):
        assert not replace(coarse, **other).same_as(coarse)
    with pytest.raises(ValueError, match="choose a divisor"):
        coarse.coarsened(2)


@pytest.mark.parametrize("shape", [(2, 3), (2, 1), (1, 1)])
def test_step(shape):
    expected = 0.0 if shape == (1, 1) else 5.6e-5
    grid = window(shape)
    assert grid.step_rad == pytest.approx(expected)
    assert grid.rays().pixel_rad == grid.step_rad


# -- the sectors of ABI


@pytest.mark.parametrize(
    ("resolution_km", "pixels", "first"),
    [
        (0.5, 21696, 0.151865),
        (1.0, 10848, 0.151858),
        (2.0, 5424, 0.151844),
        (4.0, 2712, 0.151816),
        (10.0, 1086, 0.151900),
    ],
)
def test_the_full_disc_is_that_of_the_files(resolution_km, pixels, first):
    """Pixels and offsets of the ABI files: GOES-R PUG volume 3, section 5.1.2."""
    grid = FixedGrid.abi_full_disc(resolution_km)
    assert grid.shape == (pixels, pixels)
    assert grid.x_rad[0] == pytest.approx(-first, abs=1e-12)
    assert grid.x_rad[-1] == pytest.approx(first, abs=1e-12)
    assert grid.y_rad[0] == pytest.approx(first, abs=1e-12)
    assert np.diff(grid.y_rad) == pytest.approx(-28e-6 * resolution_km, abs=1e-12)


def test_the_regional_sectors_are_those_of_the_files():
    """Corners of GOES-16 CONUS and GOES-17 PACUS files of 2 and (ACHA) 10 km."""
    conus, pacus = FixedGrid.abi_conus(2.0), FixedGrid.abi_conus(2.0, -137.0)
    assert conus.shape == pacus.shape == (1500, 2500)
    for grid in (conus, pacus):
        assert grid.y_rad[[0, -1]] == pytest.approx([0.128212, 0.044268], abs=1e-12)
    assert conus.x_rad[[0, -1]] == pytest.approx([-0.101332, 0.038612], abs=1e-12)
    assert pacus.x_rad[[0, -1]] == pytest.approx([-0.069972, 0.069972], abs=1e-12)
    coarse = FixedGrid.abi_conus(10.0, -137.2)
    assert coarse.shape == (300, 500)
    assert coarse.x_rad[0] == pytest.approx(-0.06986, abs=1e-12)
    assert coarse.y_rad[0] == pytest.approx(0.1281, abs=1e-12)


@pytest.mark.parametrize("resolution_km", [0.5, 1.0, 2.0, 4.0, 10.0])
def test_a_mesoscale_sector_is_cut_from_the_full_disc(resolution_km):
    grid = FixedGrid.abi_meso(resolution_km, 36.0, -120.0, -137.0)
    disc = FixedGrid.abi_full_disc(resolution_km, -137.0)
    assert grid.shape == (round(1000 / resolution_km),) * 2
    for own, whole in ((grid.x_rad, disc.x_rad), (-grid.y_rad, -disc.y_rad)):
        start = np.searchsorted(whole, own[0] - 1e-9)
        np.testing.assert_allclose(own, whole[start : start + own.size], atol=1e-12)
    middle = grid.scan_angles_rad(36.0, -120.0)
    assert abs(middle[0] - grid.x_rad.mean()) <= 280e-6
    assert abs(middle[1] - grid.y_rad.mean()) <= 280e-6


@pytest.mark.parametrize("sweep", ["x", "y"])
def test_scan_angles_undo_navigation(sweep):
    grid = _grid([-0.1, 0.03], [0.1, -0.07], sweep=sweep)
    ground, _ = grid.rays().ground()
    places = zip(ground.latitude_deg, ground.longitude_deg, strict=True)
    found = [grid.scan_angles_rad(float(φ), float(λ)) for φ, λ in places]
    expected = [(x, y) for y in grid.y_rad for x in grid.x_rad]
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_sectors_that_are_not_are_refused():
    with pytest.raises(ValueError, match="no grid of 3 km: its resolutions are"):
        FixedGrid.abi_conus(3.0)
    with pytest.raises(ValueError, match="cannot be seen from above longitude -75"):
        FixedGrid.abi_meso(2.0, 0.0, 20.0)


def test_tiles_of_rays_are_those_of_the_whole():
    grid = FixedGrid(np.linspace(-0.1, 0.1, 7), np.linspace(0.1, -0.1, 5), -75.0)
    whole, tile = grid.rays(), grid.rays(np.array([3, 34, 10]))
    np.testing.assert_array_equal(tile.direction, whole.direction[[3, 34, 10]])
    np.testing.assert_array_equal(tile.origin_m, whole.origin_m[[3, 34, 10]])
    assert tile.pixel_rad == whole.pixel_rad


@pytest.mark.parametrize("sweep", ["x", "y"])
def test_an_image_is_read_where_its_pixels_look(sweep):
    """At the centres the pixels themselves, between them what is linear in the scan
    angles, outside the nearest."""
    grid = _grid(np.linspace(-0.05, 0.03, 9), np.linspace(0.1, 0.04, 7), sweep=sweep)
    image = np.random.default_rng(0).random((*grid.shape, 2))
    ground, _ = grid.rays().ground()
    places = ground.latitude_deg, ground.longitude_deg
    np.testing.assert_allclose(grid.sample(image, *places), image.reshape(-1, 2))

    finer = _grid(np.linspace(-0.05, 0.03, 33), np.linspace(0.1, 0.04, 31), sweep=sweep)
    y, x = np.meshgrid(finer.y_rad, finer.x_rad, indexing="ij")
    ground, _ = finer.rays().ground()
    coarse = np.stack(np.meshgrid(grid.y_rad, grid.x_rad, indexing="ij"), axis=-1)
    read = grid.sample(coarse, ground.latitude_deg, ground.longitude_deg)
    expected = np.stack([y.ravel(), x.ravel()], axis=-1)
    np.testing.assert_allclose(read, expected, atol=1e-9)

    ground, _ = _grid([-0.06, 0.04], [0.11], sweep=sweep).rays().ground()
    outside = grid.sample(image, ground.latitude_deg, ground.longitude_deg)
    np.testing.assert_allclose(outside, image[0, [0, -1]])


def test_a_single_row_and_column_are_read_everywhere():
    image = np.array([[[7.0]]])
    found = _grid([0.01], [0.02]).sample(image, np.array([0.0]), np.array([-70.0]))
    np.testing.assert_array_equal(found, [[7.0]])


def test_grids_are_equal_by_their_numbers():
    """Scenes that hold equal grids share what is compiled for them."""
    one, same = (_grid([0.0, 0.1], [0.2, 0.1]) for _ in range(2))
    assert one == same
    assert hash(one) == hash(same)
    others = [
        _grid([0.0, 0.1], [0.2, 0.11]),
        _grid([0.0, 0.1], [0.2, 0.1], sweep="y"),
        replace(one, subsatellite_longitude_deg=-137.0),
        replace(one, ellipsoid=Ellipsoid(6.4e6, 6.4e6)),
        "something else",
    ]
    assert all(one != other for other in others)
