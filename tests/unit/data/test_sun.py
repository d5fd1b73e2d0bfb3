"""The direction of the sun in Earth-fixed axes."""

from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import pandas as pd
import pytest
from pvlib.solarposition import spa_python

from cloudjax_data import sun_direction


PLACES = [(0.0, 0.0), (37.0, -120.0), (-33.9, 151.2), (78.2, 15.6), (-89.9, 180.0)]
TIMES = [
    datetime(2019, 10, 27, 20, 0, 30, tzinfo=UTC),
    datetime(2019, 12, 1, 10, 27, 30, tzinfo=UTC),
    datetime(2022, 7, 1, 0, 2, 36, tzinfo=UTC),
]


@pytest.mark.parametrize("time", TIMES)
@pytest.mark.parametrize(("latitude", "longitude"), PLACES)
def test_zenith_angle_at_places(time, latitude, longitude):
    expected = spa_python(pd.DatetimeIndex([time]), latitude, longitude)
    up = np.array(
        [
            np.cos(np.radians(latitude)) * np.cos(np.radians(longitude)),
            np.cos(np.radians(latitude)) * np.sin(np.radians(longitude)),
            np.sin(np.radians(latitude)),
        ]
    )
    zenith = np.degrees(np.arccos(up @ sun_direction(time)))
    # parallax at the surface is up to 0.0024 degree
    assert zenith == pytest.approx(expected["zenith"].iloc[0], abs=0.003)


@pytest.mark.parametrize(
    ("time", "declination"),
    [
        # instants published by the US Naval Observatory
        (datetime(2019, 3, 20, 21, 58, tzinfo=UTC), 0.0),
        (datetime(2019, 6, 21, 15, 54, tzinfo=UTC), 23.436),
        (datetime(2019, 12, 22, 4, 19, tzinfo=UTC), -23.436),
    ],
)
def test_declination_at_equinox_and_solstices(time, declination):
    direction = sun_direction(time)
    assert np.linalg.norm(direction) == pytest.approx(1.0)
    assert np.degrees(np.arcsin(direction[2])) == pytest.approx(declination, abs=0.002)


def test_time_zones_are_honoured_and_required():
    pacific = timezone(timedelta(hours=-7))
    local = TIMES[0].astimezone(pacific)
    np.testing.assert_array_equal(sun_direction(local), sun_direction(TIMES[0]))
    with pytest.raises(ValueError, match="no time zone"):
        sun_direction(datetime(2019, 10, 27, 20))
