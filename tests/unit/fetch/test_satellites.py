"""Positions by date; the dates are in docs/guides/fetch.md, with their sources."""

from datetime import UTC, datetime

import pytest

from cloudjax_data import DataError, GoesRequest, Link, plan_gfs, plan_goes
from cloudjax_data.satellites import satellite_at


@pytest.mark.parametrize(
    ("position", "day", "satellite"),
    [
        ("east", (2017, 12, 18), "goes16"),
        ("east", (2025, 4, 6), "goes16"),
        ("east", (2025, 4, 7), "goes19"),
        ("west", (2019, 2, 12), "goes17"),
        ("west", (2023, 1, 3), "goes17"),
        ("west", (2023, 1, 4), "goes18"),
        ("goes18", (2022, 6, 1), "goes18"),
    ],
)
def test_who_stood_there(position, day, satellite):
    year, month, date = day
    time = datetime(year, month, date, 23, tzinfo=UTC)
    assert satellite_at(position, time) == satellite


@pytest.mark.parametrize(("position", "year"), [("east", 2017), ("west", 2018)])
def test_nobody_before_the_first(position, year):
    with pytest.raises(DataError, match="choose a later time"):
        satellite_at(position, datetime(year, 6, 1, tzinfo=UTC))


def test_a_time_without_a_zone_is_none():
    time = datetime(2023, 4, 26, 17)
    request = GoesRequest("east", time, "conus", (1,))
    for ask in (
        lambda: plan_goes(request, Link(endpoint="none")),
        lambda: plan_gfs(time, "1p00", Link(endpoint="/")),
    ):
        with pytest.raises(DataError, match="2023-04-26 17:00:00 has no time zone"):
            ask()


def test_other_names():
    with pytest.raises(DataError, match="'himawari8' is no satellite of the series"):
        satellite_at("himawari8", datetime(2022, 6, 1, tzinfo=UTC))
