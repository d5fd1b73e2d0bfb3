"""Which scan has which bands, where none has all."""

from datetime import UTC, datetime, timedelta

import pytest

from cloudjax_data import DataError, GoesRequest, Link, plan_goes
from tests.noaa_buckets import add_scan


TIME = datetime(2023, 4, 26, 17, 1, tzinfo=UTC)


def plan(root, bands):
    request = GoesRequest("goes16", TIME, "conus", bands, products=False)
    return plan_goes(request, Link(endpoint=str(root)))


def test_each_scan_is_told_with_its_bands(tmp_path):
    """Bands 1 and 3 of one scan and 13 of the next are all bands, and no scan."""
    add_scan(tmp_path, TIME, bands=(1, 3))
    add_scan(tmp_path, TIME + timedelta(minutes=5), bands=(13,))
    with pytest.raises(DataError) as error:
        plan(tmp_path, (1, 3, 13))
    said = str(error.value)
    assert "(that of 17:01:00 has only 1, 3; that of 17:06:00 has only 13)" in said
    assert list(item.name[18:25] for item in plan(tmp_path, (1, 3)).items) == [
        "C01_G16",
        "C03_G16",
    ]


def test_far_scans_are_counted(tmp_path):
    for minutes in (-11, -5, 0, 5, 10, 14):
        add_scan(tmp_path, TIME + timedelta(minutes=minutes), bands=(1,))
    with pytest.raises(DataError) as error:
        plan(tmp_path, (1, 13))
    said = str(error.value)
    assert said.count("has only 1") == 4
    assert "and 2 more have not all" in said
    assert "16:50" not in said


def test_no_scan_at_all(tmp_path):
    add_scan(tmp_path, TIME + timedelta(hours=5), bands=(1,))
    with pytest.raises(DataError, match="nor one of any of them"):
        plan(tmp_path, (1, 13))
