"""Cloud fractions from a weather file."""

import dataclasses
from datetime import UTC, datetime

import numpy as np
import pytest

from cloudjax import cloud_classes
from cloudjax_data import DataError, read_weather
from cloudjax_scenes import Analysis
from tests.generated import write_grib


LATITUDE = np.arange(60.0, -61.0, -30.0)
LONGITUDE = np.arange(0.0, 360.0, 30.0)
SHAPE = (LATITUDE.size, LONGITUDE.size)


def write(path, humid_levels=(1000, 700, 300)):
    """Rising, moist air in the west, sinking, dry air in the east, 275 K."""
    west = np.broadcast_to(LONGITUDE < 180, SHAPE)
    height = {1000: 100.0, 700: 3000.0, 300: 9000.0}
    fields = {}
    for level, z in height.items():
        fields |= {
            ("u", level): np.full(SHAPE, 10.0),
            ("v", level): np.zeros(SHAPE),
            ("w", level): np.where(west, -0.06, 0.06),
            ("t", level): np.full(SHAPE, 275.0),
            ("gh", level): np.full(SHAPE, z),
        }
        if level in humid_levels:
            fields["r", level] = np.where(west, 100.0, 20.0)
    time = datetime(2019, 10, 27, 18, tzinfo=UTC)
    return write_grib(
        path, fields, latitude_deg=LATITUDE, longitude_deg=LONGITUDE, time=time
    )


def _yes_or_no(cloud):
    """The conditions of a class with the paper's sharp edges, and usual humidities."""
    return dataclasses.replace(
        cloud.conditions,
        critical_relative_humidity=0.8,
        vertical_wind_width_pa_s=0.01,
        temperature_width_k=1.0,
    )


def test_cloud_stands_in_rising_moist_air(tmp_path):
    analysis = Analysis(read_weather(write(tmp_path / "gfs.grib")))
    fractions = {
        name: analysis.fractions(_yes_or_no(cloud))
        for name, cloud in cloud_classes().items()
    }
    for name in ("low_stratus", "altostratus"):
        assert np.all(fractions[name][:, LONGITUDE < 180] > 0.98)
        assert np.all(fractions[name][:, LONGITUDE >= 180] < 0.01)
    assert np.all(fractions["low_cumulus"] < 0.01)
    assert np.all(fractions["cirrus"] < 0.01)


def test_a_class_that_the_file_does_not_reach_is_refused(tmp_path):
    cube = read_weather(write(tmp_path / "gfs.grib", humid_levels=(1000, 700)))
    classes = cloud_classes()
    assert Analysis(cube).fractions(_yes_or_no(classes["low_stratus"])).max() > 0.98
    with pytest.raises(DataError, match=r"gfs\.grib has nothing at 6000 m"):
        Analysis(cube).fractions(classes["cirrus"].conditions)
