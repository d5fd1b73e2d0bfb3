"""Real WRF output, against xwrf and what the files themselves say."""

import netCDF4
import numpy as np
import pytest

from cloudjax_data import open_wrf, read_wrf


pytestmark = pytest.mark.shared_data

KATRINA = "wrf_katrina_20050828/wrfout_katrina_10km.nc"
TIBET = "wrf_tibet_20050921/wrf_d01_allvars_cropped.nc"


def _by_xwrf(path):
    pytest.importorskip("xwrf")
    import xarray as xr

    with xr.open_dataset(path) as data:
        return data.xwrf.postprocess().load()


def _places(path, number):
    """Of each time: a nest may move, which xwrf does not know."""
    with netCDF4.Dataset(path) as file:
        for name in ("XLAT", "XLONG"):
            places = file[name]
            yield np.asarray(places[number] if places.ndim == 3 else places[:])


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", [KATRINA, TIBET])
def test_heights_pressures_and_places_are_those_of_xwrf(shared_data, name):
    path = shared_data / name
    theirs = _by_xwrf(path)
    for i, frame in enumerate(open_wrf(path).frames):
        columns = read_wrf(frame)
        at = theirs.isel(Time=i)
        height = at["geopotential_height"].to_numpy()
        np.testing.assert_allclose(columns.heights_m, height, atol=0.02)
        pressure = at["air_pressure"].to_numpy()
        np.testing.assert_allclose(columns.pressure_pa, pressure, rtol=1e-6)
        kelvin = at["air_potential_temperature"] * (at["air_pressure"] / 1e5) ** (2 / 7)
        np.testing.assert_allclose(columns.temperature_k, kelvin.to_numpy(), rtol=1e-5)
        # xwrf takes distances from the attributes, and the corner from the size of
        # the whole domain: for crops only the distances are right.
        x, y = (theirs[axis].to_numpy() for axis in ("x", "y"))
        steps = np.diff(x)[0], np.diff(y)[0]
        np.testing.assert_allclose(columns.grid.spacing_m, steps, rtol=1e-4)
        latitude, longitude = _places(path, i)
        found = columns.grid.places(*columns.grid.mesh())
        np.testing.assert_allclose(found[0], latitude, atol=2e-4)
        np.testing.assert_allclose(found[1], longitude, atol=2e-4)


@pytest.mark.filterwarnings("ignore")
def test_the_map_of_the_real_file_is_that_of_xwrf(shared_data):
    theirs = _by_xwrf(shared_data / TIBET)
    projection = read_wrf(open_wrf(shared_data / TIBET).frames[0]).grid.projection
    import pyproj

    transform = pyproj.Proj(theirs["wrf_projection"].item())
    latitude, longitude = (
        theirs[n].to_numpy().astype(float) for n in ("XLAT", "XLONG")
    )
    x, y = projection.project(latitude, longitude)
    x0, y0 = transform(longitude, latitude)
    np.testing.assert_allclose(x - x[0, 0], x0 - x0[0, 0], atol=0.1)
    np.testing.assert_allclose(y - y[0, 0], y0 - y0[0, 0], atol=0.1)


def test_winds_turn_by_the_angles_of_the_file(shared_data):
    path = shared_data / TIBET
    columns = read_wrf(open_wrf(path).frames[0])
    with netCDF4.Dataset(path) as file:
        u, v = file["U"][0], file["V"][0]
        cos, sin = (np.asarray(file[n][:]) for n in ("COSALPHA", "SINALPHA"))
    u, v = (u[..., 1:] + u[..., :-1]) / 2, (v[:, 1:] + v[:, :-1]) / 2
    assert columns.winds_m_s is not None
    east, north, _ = columns.winds_m_s
    np.testing.assert_allclose(east, u * cos - v * sin, atol=2e-3)
    np.testing.assert_allclose(north, v * cos + u * sin, atol=2e-3)


def test_facts_of_the_real_files(shared_data):
    run = open_wrf(shared_data / KATRINA)
    assert [time.hour for time in run.times] == [12, 15, 18, 21]
    columns = read_wrf(run.frames[2])
    first = columns.cautions()[0]
    assert "14 of the run's 29 levels, up to 514 hPa" in first
    ice = read_wrf(open_wrf(shared_data / TIBET).frames[0])
    assert [part.phase for part in ice.condensate] == ["water", "ice"]
    assert ice.cautions() == []
    np.testing.assert_allclose(ice.heights_m[0], ice.ground_m, atol=1.0)
    assert ice.cloud_fraction is not None
    assert ice.cloud_fraction.max() == 1
