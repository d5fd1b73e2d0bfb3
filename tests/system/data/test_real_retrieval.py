"""A real COD and ACHA file, put where the clouds stand and rendered again."""

import netCDF4
import numpy as np
import pytest

from cloudjax_data import read_retrieval
from cloudjax_scenes.model_columns import depth_columns
from cloudjax_scenes.retrieved_columns import RetrievedColumns
from tests.commands import run


pytestmark = pytest.mark.shared_data

FOLDER = "goes16_cod_acha_20220701T0002"
CAMERA = """
kind = "camera"
latitude_deg = 34.0
longitude_deg = -107.1
altitude_m = 700e3
azimuth_deg = 0.0
elevation_deg = -90.0
field_of_view_deg = 36.0
rows = 60
columns = 70
"""


@pytest.fixture(scope="module")
def columns(shared_data):
    return RetrievedColumns.of(read_retrieval(shared_data / FOLDER))


def test_pixels_see_the_places_that_the_file_has(columns, shared_data):
    """The file has no projection: the satellite stands at 75 W by its name."""
    grid = columns.retrieval.grid
    ground, _ = grid.rays().ground()
    with netCDF4.Dataset(columns.retrieval.paths[0]) as file:
        places = file["lat"][:].ravel(), file["lon"][:].ravel()
    found = ground.latitude_deg, ground.longitude_deg
    np.testing.assert_allclose(found, places, atol=5e-4)


def test_columns_have_the_optical_depth_of_the_file(columns):
    """Overlap, slopes and hidden ground change the mean by some percent."""
    depth, product = depth_columns(columns).column_depth, columns.retrieval
    assert depth.max() == pytest.approx(product.optical_depth.max(), rel=1e-4)
    assert depth.sum() == pytest.approx(product.optical_depth.sum(), rel=0.1)
    assert (depth > 0).sum() == pytest.approx(product.cloudy.sum(), rel=0.1)
    assert product.unknown.sum() == 1725


def test_the_clouds_are_rendered_from_straight_above(columns, shared_data, tmp_path):
    """From another place than the satellite's the mean optical depth is the product's,
    over the area of the columns, to 5 %.
    """
    (tmp_path / "camera.toml").write_text(CAMERA)
    out, of = tmp_path / "out.nc", ("--retrieval", shared_data / FOLDER)
    result = run("render", tmp_path / "camera.toml", *of, "--bands", 2, "-o", out)
    assert result.exit_code == 0, result.output
    assert "1725 of 8755 pixels are unknown" in result.output
    with netCDF4.Dataset(out) as file:
        depth = np.ma.filled(file["cloud_optical_depth"][:], np.nan)
    pixel_m = 2 * 700e3 * np.tan(np.radians(18)) / 70
    found = np.nansum(depth) * pixel_m**2
    assert found == pytest.approx(depth_columns(columns).extinction_area_m2(), rel=0.05)
