"""GRIB files as people have them: padded, cut, doubled, mixed; right or a sentence."""

import itertools as it
import struct
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from cloudjax_data import DataError, read_weather
from cloudjax_data.grib_messages import message_offsets
from tests.generated_grib import write_grib, write_lambert_grib


TIME = datetime(2019, 10, 27, 18, tzinfo=UTC)
LATITUDE, LONGITUDE = np.arange(60.0, -61.0, -30.0), np.arange(0.0, 360.0, 30.0)
SHAPE = LATITUDE.size, LONGITUDE.size
HEIGHT = {1000: 110.0, 850: 1500.0, 500: 5600.0, 300: 9200.0}
NAMES = ("u", "v", "w", "r", "t", "gh")


def all_fields(levels=HEIGHT, names=NAMES):
    rng = np.random.default_rng(3)
    ranges = {"u": 20, "v": 20, "w": 1, "r": 90, "t": 280, "gh": 40}
    return {
        (name, level): rng.uniform(0.5, 1.0, SHAPE) * ranges[name]
        + (HEIGHT[level] if name == "gh" else 0.0)
        for level in levels
        for name in names
    }


def write(path, fields, time=TIME, edition=2, extra=None):
    return write_grib(
        path,
        fields,
        latitude_deg=LATITUDE,
        longitude_deg=LONGITUDE,
        time=time,
        edition=edition,
        extra=extra,
    )


@pytest.fixture(params=[1, 2])
def file(tmp_path, request):
    return write(tmp_path / "w.grib", all_fields(), edition=request.param)


def require_same(path, expected):
    found = read_weather(path)
    assert found.valid_time == expected.valid_time
    for name in NAMES:
        np.testing.assert_array_equal(found.data[name], expected.data[name])


# -- what is before, between and after messages


@pytest.mark.parametrize(
    "padding", [b"\n", b"\r\n", b"\0" * 700, b" \n\x1a", b"\xff" * 9]
)
def test_padding_after_the_last_message(file, padding):
    expected = read_weather(file)
    file.write_bytes(file.read_bytes() + padding)
    require_same(file, expected)


@pytest.mark.parametrize("between", [b"\0" * 20, b"\r\r\n\x03\x01\r\r\n"])
def test_padding_between_messages(file, between):
    expected = read_weather(file)
    content = file.read_bytes()
    starts = [*message_offsets(file), len(content)]
    parts = [content[i:j] for i, j in it.pairwise(starts)]
    file.write_bytes(between.join(parts))
    require_same(file, expected)


def test_the_heading_of_a_bulletin(file):
    expected = read_weather(file)
    heading = b"\r\r\n018 \r\r\nYUQA85 KWBC 271800\r\r\n"
    content = file.read_bytes()
    cut = message_offsets(file)[3]
    file.write_bytes(heading + content[:cut] + heading + content[cut:])
    require_same(file, expected)


@pytest.mark.parametrize(
    ("rest", "sentence"),
    [
        (b"G", "something that is no GRIB message: it is truncated"),
        (b"GRI", "something that is no GRIB message: it is truncated"),
        (b"GRIB", "is truncated: it ends at byte"),
        (b"GRIB\0\0\0\2" + bytes([0, 0, 0, 0, 0, 0, 9, 9]), "is truncated: it ends"),
        (b"<html>503</html>", "something that is no GRIB message"),
        (b"7777", "something that is no GRIB message"),
    ],
)
def test_what_is_left_of_a_message_is_not_padding(file, rest, sentence):
    file.write_bytes(file.read_bytes() + rest)
    with pytest.raises(DataError, match=sentence):
        read_weather(file)


def test_a_damaged_head_does_not_hide_a_level(file):
    """eccodes goes on to the next head that it knows, and says nothing."""
    content = bytearray(file.read_bytes())
    content[message_offsets(file)[7]] ^= 1
    file.write_bytes(content)
    with pytest.raises(DataError, match="something that is no GRIB message"):
        read_weather(file)


def test_a_file_that_ends_anywhere_within_a_message(file):
    content, starts = file.read_bytes(), message_offsets(file)
    last = starts[-1]
    for end in (*range(last + 1, last + 60, 7), len(content) - 4, len(content) - 1):
        file.write_bytes(content[:end])
        with pytest.raises(DataError, match="truncated"):
            read_weather(file)


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"", "is empty"),
        (b"\n", "is not a GRIB file"),
        # what macOS leaves beside a file on other disks
        (
            b"\x00\x05\x16\x07\x00\x02\x00\x00Mac OS X        " + b"\0" * 60,
            "is not a GR",
        ),
        (b"1:0:d=2019102718:UGRD:850 mb:anl:\n", "is not a GRIB file"),
        (b"\x1f\x8b\x08\x00" + b"GRIB" * 4, "is not a GRIB file"),
        (b"BUFR\0\0\x08\x047777", "is not a GRIB file"),
        (b"GRIB2 files are fetched by FTP, says the server\n", "is not a GRIB file"),
    ],
)
def test_strangers_are_no_grib(tmp_path, content, sentence):
    path = tmp_path / "._gfs.grib2"
    path.write_bytes(content)
    with pytest.raises(DataError, match=sentence):
        read_weather(path)


# -- fields twice, mixed, or of another kind


def test_a_message_twice_counts_once(file):
    expected = read_weather(file)
    file.write_bytes(file.read_bytes() * 2)
    require_same(file, expected)


def test_two_values_for_one_level_are_refused(tmp_path, file):
    other = all_fields()[("t", 500)] + 1.0
    more = write(tmp_path / "more.grib", {("t", 500): other})
    file.write_bytes(file.read_bytes() + more.read_bytes())
    with pytest.raises(DataError, match="'t' at 500 hPa twice, with different values"):
        read_weather(file)


def test_the_order_of_messages_means_nothing(file):
    expected = read_weather(file)
    content = file.read_bytes()
    starts = [*message_offsets(file), len(content)]
    parts = [content[i:j] for i, j in it.pairwise(starts)]
    np.random.default_rng(0).shuffle(parts)
    file.write_bytes(b"".join(parts))
    require_same(file, expected)


@pytest.mark.parametrize(
    "kind",
    [
        {"productDefinitionTemplateNumber": 2, "derivedForecast": 4},
        {"productDefinitionTemplateNumber": 8, "typeOfStatisticalProcessing": 0},
        {"typeOfGeneratingProcess": 7},
    ],
    ids=["spread", "average", "error"],
)
def test_spreads_and_averages_are_not_the_field(tmp_path, kind):
    """A spread of 1 K is a possible temperature, and of the same short name."""
    plain = write(tmp_path / "w.grib", all_fields())
    expected = read_weather(plain)
    temperatures = {key: v for key, v in all_fields().items() if key[0] == "t"}
    other = write(
        tmp_path / "other.grib",
        {k: v / 250 for k, v in temperatures.items()},
        extra=kind,
    ).read_bytes()
    plain.write_bytes(other + plain.read_bytes())
    require_same(plain, expected)
    rest = {key: v for key, v in all_fields().items() if key[0] != "t"}
    only = write(tmp_path / "only.grib", rest)
    only.write_bytes(only.read_bytes() + other)
    # eccodes calls averages avg_t
    sentence = "has (no 't' on press|'t' only as averages over time, spreads)"
    with pytest.raises(DataError, match=sentence):
        read_weather(only)


def test_the_mean_of_an_ensemble_is_a_field(tmp_path):
    mean = {"productDefinitionTemplateNumber": 2, "derivedForecast": 0}
    path = write(tmp_path / "w.grib", all_fields(), extra=mean)
    expected = all_fields()["t", 500][::-1]
    np.testing.assert_allclose(read_weather(path).data["t"][2], expected, rtol=1e-5)


def test_members_of_an_ensemble_are_not_mixed(tmp_path):
    member = {"productDefinitionTemplateNumber": 1, "perturbationNumber": 3}
    fields = all_fields()
    path = write(tmp_path / "w.grib", fields, extra=member)
    expected = read_weather(path)
    path.write_bytes(path.read_bytes() * 2)
    require_same(path, expected)
    one = {k: v for k, v in fields.items() if k[0] == "t"}
    rest = {k: v for k, v in fields.items() if k[0] != "t"}
    path = write(tmp_path / "w.grib", one, extra=member | {"perturbationNumber": 4})
    other = write(tmp_path / "o.grib", rest, extra=member)
    path.write_bytes(path.read_bytes() + other.read_bytes())
    with pytest.raises(DataError, match="several members of an ensemble"):
        read_weather(path)
    some = {k: v for k, v in one.items() if k[1] == 500}
    more = write(tmp_path / "w.grib", one, extra=member).read_bytes()
    path = write(tmp_path / "w.grib", some, extra=member | {"perturbationNumber": 4})
    path.write_bytes(path.read_bytes() + other.read_bytes() + more)
    with pytest.raises(DataError, match="'t' for several values of number"):
        read_weather(path)


@pytest.mark.parametrize("edition", [1, 2])
def test_the_skin_of_another_hour_is_refused(tmp_path, edition):
    path = write(tmp_path / "w.grib", all_fields(), edition=edition)
    later = write(
        tmp_path / "skin.grib",
        {("t", 0): np.full(SHAPE, 300.0)},
        edition=edition,
        time=TIME + timedelta(hours=6),
    )
    path.write_bytes(path.read_bytes() + later.read_bytes())
    with pytest.raises(DataError, match="holds several times"):
        read_weather(path)


def test_land_of_another_hour_is_the_same_land(tmp_path):
    path = write(tmp_path / "w.grib", all_fields())
    land = write(
        tmp_path / "land.grib",
        {("lsm", 0): np.ones(SHAPE), ("orog", 0): np.full(SHAPE, 9.0)},
        time=TIME - timedelta(hours=6),
    )
    path.write_bytes(path.read_bytes() + land.read_bytes())
    cube = read_weather(path)
    assert (cube.data["lsm"] == 1).all()
    assert cube.valid_time == TIME


def test_levels_in_pascals(tmp_path):
    """925.5 hPa are no whole number of hectopascals, and 9250 Pa are 92.5."""
    path = write(tmp_path / "w.grib", all_fields())
    fields = {
        (name, 9250): all_fields()[name, 300] + 7000.0 * (name == "gh")
        for name in NAMES
    }
    high = write(tmp_path / "high.grib", fields)
    path.write_bytes(path.read_bytes() + high.read_bytes())
    cube = read_weather(path)
    np.testing.assert_array_equal(cube.data["level"], [1000, 850, 500, 300, 92.5])
    np.testing.assert_allclose(cube.data["t"][-1], fields["t", 9250][::-1], rtol=1e-5)


def test_heights_that_do_not_rise_are_refused(tmp_path):
    fields = all_fields()
    fields["gh", 850], fields["gh", 500] = fields["gh", 500], fields["gh", 850]
    path = write(tmp_path / "w.grib", fields)
    with pytest.raises(DataError, match="do not rise from 850 to 500 hPa"):
        read_weather(path)


def test_some_winds_along_a_map_and_some_not_are_refused(tmp_path):
    fields = {k: np.resize(v, (6, 8)) for k, v in all_fields().items()}
    fields |= {("gh", level): np.full((6, 8), HEIGHT[level]) for level in HEIGHT}
    one = {k: v for k, v in fields.items() if k[0] == "u"}
    rest = {k: v for k, v in fields.items() if k[0] != "u"}
    path = write_lambert_grib(tmp_path / "l.grib", one, wind_relative_to_grid=False)
    other = write_lambert_grib(tmp_path / "o.grib", rest)
    path.write_bytes(path.read_bytes() + other.read_bytes())
    with pytest.raises(DataError, match="some winds along its grid and some"):
        read_weather(path)


@pytest.mark.parametrize(
    "packing", ["grid_complex", "grid_complex_spatial_differencing"]
)
def test_values_that_a_packing_calls_missing(tmp_path, packing):
    """Complex packing has missing values of its own, without a bitmap."""
    fields = all_fields()
    fields["t", 850][1, 2] = np.nan
    cube = read_weather(
        write(tmp_path / "w.grib", fields, extra={"packingType": packing})
    )
    missing = np.isnan(cube.data["t"].to_numpy())
    assert missing[1, 3, 2]
    assert missing.sum() == 1


def test_a_date_that_does_not_exist_is_refused(tmp_path):
    path = write(tmp_path / "w.grib", all_fields())
    content = bytearray(path.read_bytes())
    stamp = struct.pack(">HBB", 2019, 10, 27)
    at = content.find(stamp)
    while at >= 0:
        content[at : at + 4] = struct.pack(">HBB", 2019, 13, 40)
        at = content.find(stamp, at)
    path.write_bytes(content)
    with pytest.raises(DataError, match="a time that does not exist"):
        read_weather(path)


def test_what_is_lacking_is_said(tmp_path):
    fields = all_fields()
    del fields["r", 850]
    notes = read_weather(write(tmp_path / "w.grib", fields)).notes
    assert notes == (
        "w.grib lacks r at 850 hPa: nothing is taken from that level.",
        "w.grib ends at 300 hPa: the air above is that of the standard atmosphere.",
    )
