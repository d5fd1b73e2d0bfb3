"""Specific humidity, against printed tables and the analysis's own water."""

import numpy as np
import pytest

from cloudjax.air.gases import columns
from cloudjax_data import read_weather, specific_humidity
from cloudjax_data.grib import read_grib
from cloudjax_data.humidity import saturation_hpa
from cloudjax_scenes.air_profile import profiles_of


def test_saturation_is_that_of_the_tables():
    """Smithsonian Meteorological Tables: over ice at -40 and -30 °C, over water at 0,
    20 and 30 °C, hPa, within 0.5 %.
    """
    kelvin = 273.15 + np.array([-40.0, -30.0, 0.01, 20.0, 30.0])
    expected = [0.1283, 0.3798, 6.1115, 23.373, 42.430]
    np.testing.assert_allclose(saturation_hpa(kelvin), expected, rtol=5e-3)


def test_humidity_is_the_share_of_vapour():
    """20 °C, half saturated, 1000 hPa: e = 11.69 hPa, q = 7.30 g/kg."""
    q = specific_humidity(np.array([50.0]), np.array([293.15]), np.array([1000.0]))
    assert q[0] == pytest.approx(7.30e-3, rel=5e-3)


def test_impossible_humidities_are_brought_back():
    given = np.array([-5.0, 100.0, 130.0, np.nan, 100.0])
    kelvin = np.array([280.0, 280.0, 280.0, 280.0, 320.0])
    q = specific_humidity(given, kelvin, np.array([900.0, 900, 900, 900, 1.0]))
    assert q[0] == 0
    assert q[1] == q[2] > 0
    assert np.isnan(q[3])
    assert q[4] < 0.1


@pytest.mark.shared_data
def test_water_above_the_sea_is_that_of_the_analysis(shared_data):
    """The GFS's own precipitable water: mean within 1 %, deviation of 0.4 kg/m²."""
    file = shared_data / "gfs_2p5deg_20110115T12/gfs.t12z.pgrbf120.2p5deg.grib2"
    key = ("atmosphereSingleLayer", "pwat")
    (water,) = read_grib(file, [key]).fields
    cube = read_weather(file)
    axes = (cube.data[axis].to_numpy() for axis in ("latitude", "longitude"))
    φ, λ = (x.ravel() for x in np.meshgrid(*axes, indexing="ij"))
    found = 10 * columns(*profiles_of(cube)(φ, λ)).water[:, 0]
    low = cube.data["orog"].to_numpy().ravel() < 50
    expected = water.values.ravel()[low]
    error = found[low] - expected
    assert abs(error.mean()) < 0.01 * expected.mean()
    assert error.std() < 0.4
