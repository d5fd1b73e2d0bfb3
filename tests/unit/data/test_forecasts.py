"""Forecasts: when they hold, and which means over the hours before serve."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from cloudjax_data import read_weather
from cloudjax_data.grib import GribField
from cloudjax_data.grib_grid import GribGrid, Scan
from cloudjax_data.weather_sky import sky_of
from tests.generated_grib import write_grib


START = datetime(2019, 10, 27, 18, tzinfo=UTC)
LATITUDE, LONGITUDE = np.arange(60.0, -61.0, -30.0), np.arange(0.0, 360.0, 30.0)
SHAPE = LATITUDE.size, LONGITUDE.size
HEIGHT = {1000: 110.0, 500: 5600.0}


@pytest.mark.parametrize("edition", [1, 2])
def test_a_forecast_is_of_the_time_that_it_tells_of(tmp_path, edition):
    """Nine hours on from a start at 18 UTC, on the next day."""
    fields = {
        (name, level): np.full(SHAPE, height if name == "gh" else 50.0)
        for level, height in HEIGHT.items()
        for name in ("u", "v", "w", "r", "t", "gh")
    }
    file = write_grib(
        tmp_path / "gfs.grib2",
        fields,
        latitude_deg=LATITUDE,
        longitude_deg=LONGITUDE,
        time=START,
        edition=edition,
        extra={"step": 9},
    )
    assert read_weather(file).valid_time == START + timedelta(hours=9)


def _cover(percent: float, mean_hours: float) -> GribField:
    """Low cloud, everywhere the same."""
    scan = Scan(False, True, False, False)
    return GribField(
        level_type="lowCloudLayer",
        name="lcc",
        units="%",
        level=0.0,
        start=START,
        valid_time=START + timedelta(hours=6),
        member=None,
        grid=GribGrid(scan, LATITUDE[::-1], LONGITUDE),
        winds_along_grid=False,
        values=np.full(SHAPE, percent, np.float32),
        mean_hours=mean_hours,
    )


def test_a_value_comes_before_a_mean_and_a_short_mean_before_a_long_one():
    """In any order of the file; what holds at another time is none of them."""
    long, short, value = _cover(30.0, 6.0), _cover(20.0, 1.0), _cover(10.0, 0.0)
    early = replace(value, valid_time=START)

    def chosen(*fields):
        sky = sky_of(fields, value)
        return float(sky.values["cover_low"].max()), "cover_low" in sky.means

    for fields in ((long, short, value), (value, short, long)):
        assert chosen(*fields) == (10.0, False)
    for fields in ((long, short, early), (early, short, long)):
        assert chosen(*fields) == (20.0, True)
    assert chosen(long) == (30.0, True)
