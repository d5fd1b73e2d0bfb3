"""Pixels that see space count for nothing, however good their flags are."""

import numpy as np
import pyproj
import pytest

from cloudjax import FixedGrid
from cloudjax_data import read_band
from tests.generated import window, write_abi_l1b


def _by_pyproj(grid: FixedGrid) -> np.ndarray:
    crs = pyproj.Proj(
        proj="geos",
        h=grid.perspective_height_m,
        lon_0=grid.subsatellite_longitude_deg,
        sweep="x",
        ellps="GRS80",
    )
    h = grid.perspective_height_m
    x, y = np.meshgrid(grid.x_rad * h, grid.y_rad * h)
    return np.isfinite(crs(x, y, inverse=True)[0])


@pytest.mark.parametrize(
    "grid",
    [
        FixedGrid.abi_full_disc(10.0, -75.2),
        window((40, 40), 5.6e-4, west_edge_rad=0.1344, north_edge_rad=0.0112),
        window((40, 40), 5.6e-4, west_edge_rad=-0.1232, north_edge_rad=0.1232),
    ],
    ids=["disc", "eastern limb", "north-western limb"],
)
def test_the_earth_is_where_pyproj_has_it(grid):
    expected = _by_pyproj(grid)
    assert 0.05 < expected.mean() < 0.95
    np.testing.assert_array_equal(grid.sees_the_earth(), expected)


@pytest.mark.parametrize("block", [1, 2])
def test_good_flags_in_space_are_not_believed(tmp_path, block):
    grid = window((40, 40), 5.6e-4, west_edge_rad=0.1344, north_edge_rad=0.0112)
    radiance = np.where(_by_pyproj(grid), 80.0, 0.1)
    path = write_abi_l1b(tmp_path, band=13, radiance=radiance, grid=grid)
    band = read_band(path, block=block)
    blocks = (40 // block, block, 40 // block, block)
    expected = _by_pyproj(grid).reshape(blocks).all(axis=(1, 3))
    np.testing.assert_array_equal(band.good, expected)
    assert np.nanmin(band.radiance) > 79.0
