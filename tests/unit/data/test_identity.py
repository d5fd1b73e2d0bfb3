"""What a file says of itself: times in UTC, whatever the machine, and one scan."""

import os
import time
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from cloudjax_data import DataError, read_band
from tests.generated import SCAN_START, write_abi_l1b
from tests.mutations.netcdf_content import changed


SHAPE = (3, 4)


@pytest.fixture
def path(tmp_path):
    return write_abi_l1b(tmp_path, band=13, radiance=np.full(SHAPE, 60.0))


@pytest.fixture
def in_denver():
    """The computer's own zone, seven hours behind."""
    before = os.environ.get("TZ")
    os.environ["TZ"] = "America/Denver"
    time.tzset()
    yield
    if before is None:
        del os.environ["TZ"]
    else:
        os.environ["TZ"] = before
    time.tzset()


@pytest.mark.parametrize(
    "text",
    [
        "2019-10-27T20:00:27.5Z",
        "2019-10-27T20:00:27.5",
        "2019-10-27 20:00:27.5",
        "2019-10-27T13:00:27.5-07:00",
    ],
)
def test_times_are_utc_unless_they_say_otherwise(path, in_denver, text):
    def say(content):
        content.attributes["time_coverage_start"] = text

    assert datetime.now().astimezone().utcoffset() != timedelta(0)
    assert read_band(changed(path, say)).start == SCAN_START


def test_the_variable_t_must_agree(path):
    def later(content):
        content.variables["t"].stored = content.variables["t"].stored + 7 * 3600

    said = "starts at 2019-10-27 20:00:27 and its variable 't' says 2019-10-28 03:00:30"
    with pytest.raises(DataError, match=said):
        read_band(changed(path, later))


def test_the_variable_t_may_count_otherwise(path):
    """As xarray writes it, from another date and in other units."""

    def in_days(content):
        held = content.variables["t"]
        middle = SCAN_START + timedelta(seconds=2.85)
        held.stored = np.float64((middle - datetime(2019, 10, 1, tzinfo=UTC)).days)
        held.stored += (20 * 3600 + 30.35) / 86400
        held.attributes = {"units": "days since 2019-10-01", "calendar": "standard"}

    assert read_band(changed(path, in_days)).start == SCAN_START


def test_the_name_must_agree(path):
    """The file of another scan, renamed: neither of the two is believed."""
    other = path.with_name(path.name.replace("s20193002000275", "s20193002100275"))
    path.rename(other)
    with pytest.raises(DataError, match=r"its name says .* 21:00:27, its header .* 20"):
        read_band(other)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("_G17_", "_G16_", "its name is of G16, its header of G17"),
        ("RadM1", "RadM2", "its names are of sectors M1 and M2"),
        ("C13_", "C14_", "its name is of band 14, its header of band 13"),
    ],
)
def test_a_name_of_another_file_is_refused(path, old, new, said):
    other = path.with_name(path.name.replace(old, new))
    path.rename(other)
    with pytest.raises(DataError, match=said):
        read_band(other)


def test_a_scan_ends_after_it_starts(path):
    def turn(content):
        a, b = "time_coverage_start", "time_coverage_end"
        content.attributes[a], content.attributes[b] = (
            content.attributes[b],
            content.attributes[a],
        )

    with pytest.raises(DataError, match=r"its scan is from .* to "):
        read_band(changed(path, turn))


def test_a_file_without_a_name_has_a_sector(path):
    def nameless(content):
        del content.attributes["dataset_name"]

    assert read_band(changed(path, nameless)).sector == "M1"
    renamed = path.with_name("mine.nc")
    path.rename(renamed)
    assert read_band(renamed).sector == "M"


@pytest.mark.parametrize(
    ("variable", "value", "said"),
    [
        ("band_id", np.array([14], "i1"), "is of band 13, its header of band 14|12.27"),
        ("band_id", np.array([77], "i1"), "has 77 for 'band_id'"),
        ("band_wavelength", np.array([11.19], "f4"), "band 13 is at 11.19 um"),
        ("planck_fk1", np.float32(8510.22), "fk1 is 8510.22, and 10835.6 nominally"),
        ("planck_bc2", np.float32(0.9), "bc2 is 0.9"),
    ],
)
def test_a_band_that_contradicts_itself_is_refused(path, variable, value, said):
    def spoil(content):
        content.variables[variable].stored = value

    with pytest.raises(DataError, match=said):
        read_band(changed(path, spoil))
