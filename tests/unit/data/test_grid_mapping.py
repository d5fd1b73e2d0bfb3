"""The CF description of scan angles."""

import numpy as np
import pytest
import xarray as xr

from cloudjax_data import GRID_MAPPING, cf_attributes, fixed_grid_coordinates
from tests.generated import window


pyproj = pytest.importorskip("pyproj")


def test_cf_attributes_mean_the_geostationary_projection():
    grid = window((4, 4), subsatellite_longitude_deg=-75.0)
    crs = pyproj.CRS.from_cf(cf_attributes(grid))
    to_degrees = pyproj.Proj(crs)
    h = grid.perspective_height_m
    # the worked example of the product user's guide (PUG volume 3, 5.1.2.8)
    longitude, latitude = to_degrees(-0.024052 * h, 0.095340 * h, inverse=True)
    assert latitude == pytest.approx(33.846162, abs=1e-6)
    assert longitude == pytest.approx(-84.690932, abs=1e-6)


def test_coordinates_survive_a_file(tmp_path):
    grid = window((3, 5))
    data = xr.DataArray(np.zeros(grid.shape), dims=("y", "x"))
    data.encoding["grid_mapping"] = GRID_MAPPING
    dataset = xr.Dataset({"a": data}, coords=fixed_grid_coordinates(grid))
    dataset.to_netcdf(tmp_path / "a.nc")
    with xr.open_dataset(tmp_path / "a.nc", decode_coords="all") as back:
        np.testing.assert_array_equal(back["x"], grid.x_rad)
        assert back["x"].attrs["units"] == "rad"
        assert back["y"].attrs["standard_name"] == "projection_y_coordinate"
        assert back[GRID_MAPPING].attrs == pytest.approx(cf_attributes(grid))
        assert back["a"].encoding["grid_mapping"] == GRID_MAPPING
        assert "coordinates" not in back["a"].encoding
