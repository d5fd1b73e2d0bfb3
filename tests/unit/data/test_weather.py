"""Weather files of every shape, read into one kind of cube or refused in words."""

import struct
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
import pytest

from cloudjax_data import (
    DataError,
    WeatherSeries,
    check_altitude,
    check_time,
    read_weather,
)
from tests.generated import write_grib, write_lambert_grib


NAMES = ("u", "v", "w", "r", "t", "gh")
LEVELS = (1000, 850, 500, 300)
LATITUDE = np.arange(60.0, -61.0, -30.0)
LONGITUDE = np.arange(0.0, 360.0, 30.0)
HEIGHT = {1000: 110.0, 850: 1500.0, 500: 5600.0, 300: 9200.0}
TIME = datetime(2019, 10, 27, 18, tzinfo=UTC)


def fields_of(shape, names=NAMES, levels=LEVELS):
    rng = np.random.default_rng(0)
    fields = {
        (name, level): rng.uniform(1.0, 10.0, shape)
        for name in names
        for level in levels
    }
    for level in levels:
        if "gh" in names:
            fields["gh", level] = HEIGHT[level] + rng.uniform(0.0, 50.0, shape)
    return fields


@pytest.fixture
def fields():
    return fields_of((LATITUDE.size, LONGITUDE.size))


def write(folder, fields, **options: Any):
    options = {"latitude_deg": LATITUDE, "longitude_deg": LONGITUDE} | options
    return write_grib(folder / "weather.grib", fields, **options)


@pytest.mark.parametrize("edition", [1, 2])
def test_a_global_file(tmp_path, fields, edition):
    cube = read_weather(write(tmp_path, fields, edition=edition, time=TIME))
    assert cube.valid_time == TIME
    assert cube.is_global
    assert cube.projection is None
    np.testing.assert_array_equal(cube.data["level"], LEVELS)
    np.testing.assert_array_equal(cube.data["latitude"], LATITUDE[::-1])
    np.testing.assert_array_equal(cube.data["longitude"], LONGITUDE)
    assert cube.data["w"].attrs["units"] == "Pa s**-1"
    for name in NAMES:
        assert cube.data[name].dims == ("level", "latitude", "longitude")
        expected = np.stack([fields[name, level][::-1] for level in LEVELS])
        np.testing.assert_allclose(cube.data[name], expected, rtol=1e-5, atol=1e-2)


def test_reading_leaves_no_index_and_logs_nothing(tmp_path, fields, caplog):
    path = write(tmp_path, fields)
    read_weather(path)
    assert list(tmp_path.iterdir()) == [path]
    assert caplog.records == []


def test_a_regional_grid_across_greenwich_stays_in_one_piece(tmp_path):
    longitude = np.array([340.0, 350.0, 0.0, 10.0, 20.0])
    fields = fields_of((5, 5))
    cube = read_weather(write(tmp_path, fields, longitude_deg=longitude))
    np.testing.assert_array_equal(
        cube.data["longitude"], [340.0, 350.0, 360.0, 370.0, 380.0]
    )
    assert not cube.is_global
    expected = fields["t", 1000][::-1]
    np.testing.assert_allclose(cube.data["t"][0], expected, rtol=1e-5)


def test_a_global_grid_that_starts_at_the_date_line(tmp_path, fields):
    longitude = np.roll(LONGITUDE, 6)
    cube = read_weather(write(tmp_path, fields, longitude_deg=longitude))
    np.testing.assert_array_equal(cube.data["longitude"], LONGITUDE)
    expected = np.roll(fields["t", 1000], 6, axis=1)[::-1]
    np.testing.assert_allclose(cube.data["t"][0], expected, rtol=1e-5)


def test_a_missing_meridian_is_refused(tmp_path):
    fields = fields_of((5, 11))
    path = write(tmp_path, fields, longitude_deg=LONGITUDE[:-1])
    with pytest.raises(DataError, match=r"weather\.grib lacks a meridian"):
        read_weather(path)


@pytest.mark.parametrize("column", [0, 5, 11])
def test_any_one_missing_meridian_is_refused(tmp_path, fields, column):
    """The first and the last leave a gap round the circle, any may be masked."""
    for values in fields.values():
        values[:, column] = np.nan
    with pytest.raises(DataError, match=rf"lacks 1 of 12 meridians.*{column * 30} deg"):
        read_weather(write(tmp_path, fields))
    if column == 5:
        return
    without = {k: np.delete(v, column, axis=1) for k, v in fields.items()}
    path = write(tmp_path, without, longitude_deg=np.delete(LONGITUDE, column))
    with pytest.raises(DataError, match=r"weather\.grib lacks a meridian"):
        read_weather(path)


def test_a_meridian_missing_from_one_variable_is_refused(tmp_path, fields):
    for level in LEVELS:
        fields["r", level][:, 3] = np.nan
    with pytest.raises(DataError, match="1 of 12 meridians of 'r', first that of 90"):
        read_weather(write(tmp_path, fields))


@pytest.mark.parametrize("edition", [1, 2])
def test_humidity_on_fewer_levels_than_temperature(tmp_path, fields, edition):
    del fields["r", 500]
    cube = read_weather(write(tmp_path, fields, edition=edition))
    np.testing.assert_array_equal(cube.data["level"], [1000.0, 850.0, 300.0])
    assert cube.lost_levels_hpa["t"] == (500.0,)
    found = cube.at_altitude(5000.0)
    height = cube.data["gh"].to_numpy()[:, 2, 3]
    for name in ("r", "t"):
        column = cube.data[name].to_numpy()[:, 2, 3]
        expected = np.interp(5000.0, height, column)
        assert found[name][2, 3] == pytest.approx(expected, rel=1e-5)


def test_a_level_that_is_all_masked_is_one_that_is_not_there(tmp_path, fields):
    fields["r", 500][:] = np.nan
    cube = read_weather(write(tmp_path, fields))
    np.testing.assert_array_equal(cube.data["level"], [1000.0, 850.0, 300.0])
    assert np.isfinite(cube.at_altitude(5000.0)["r"]).all()


def test_too_low_humidity_is_refused_where_it_is_needed(tmp_path, fields):
    del fields["r", 500], fields["r", 300]
    cube = read_weather(write(tmp_path, fields))
    check_altitude(cube, 1000.0)
    with pytest.raises(DataError, match=r"nothing at 6000 m.*from 1000 to 850 hPa"):
        check_altitude(cube, 6000.0)


def test_mountains_are_no_reason_to_refuse_an_altitude(tmp_path, fields):
    ground = np.full((5, 12), 3000.0)
    ground[0] = 100.0
    cube = read_weather(write(tmp_path, {**fields, ("orog", 0): ground}))
    check_altitude(cube, 2000.0)


@pytest.mark.parametrize("edition", [1, 2])
def test_numbers_that_stand_for_missing_are_refused(tmp_path, fields, edition):
    fields["t", 850][1, 2] = 9.999e20
    with pytest.raises(DataError, match=r"has 't' of 9\.9.*e\+20 at 1 points"):
        read_weather(write(tmp_path, fields, edition=edition))


def test_nan_that_is_not_masked_is_nan(tmp_path, fields):
    """Packed as IEEE floats, a message may hold NaN itself."""
    fields["t", 850][1, 2] = 5.4321
    path = write(tmp_path, fields, extra={"packingType": "grid_ieee"})
    packed, number = path.read_bytes(), struct.pack(">f", 5.4321)
    assert packed.count(number) == 1
    path.write_bytes(packed.replace(number, struct.pack(">f", np.nan)))
    missing = np.isnan(read_weather(path).data["t"].to_numpy())
    assert missing[1, 3, 2]
    assert missing.sum() == 1


# -- at the ground


@pytest.mark.parametrize("edition", [1, 2])
def test_the_ground_is_read_where_the_file_has_it(tmp_path, fields, edition):
    rng = np.random.default_rng(1)
    ground = {
        "t_surface": (("t", 0), rng.uniform(250.0, 310.0, (5, 12))),
        "t_2m": (("2t", 2), rng.uniform(250.0, 310.0, (5, 12))),
        "lsm": (("lsm", 0), rng.integers(0, 2, (5, 12)).astype(float)),
        "orog": (("orog", 0), rng.uniform(0.0, 100.0, (5, 12))),
    }
    path = write(tmp_path, fields | dict(ground.values()), edition=edition)
    cube = read_weather(path)
    for name, (_, values) in ground.items():
        assert cube.data[name].dims == ("latitude", "longitude")
        np.testing.assert_allclose(cube.data[name], values[::-1], rtol=1e-4)
    assert set(cube.at_altitude(3000.0).data_vars) == {"u", "v", "w", "r", "t"}


def test_grib1_in_the_numbers_of_ncep(tmp_path, fields):
    """Parameter 7 is the height of a level, or of the ground at the surface."""
    ncep = {"centre": 7, "table2Version": 2}
    flat = {("orog", 0): np.full((5, 12), 20.0), ("t", 0): np.full((5, 12), 290.0)}
    cube = read_weather(write(tmp_path, fields | flat, edition=1, extra=ncep))
    np.testing.assert_allclose(cube.data["orog"], 20.0, rtol=1e-4)
    np.testing.assert_allclose(cube.data["t_surface"], 290.0, rtol=1e-4)
    expected = np.stack([fields["gh", level][::-1] for level in LEVELS])
    np.testing.assert_allclose(cube.data["gh"], expected, rtol=1e-4)
    assert cube.data["w"].attrs["units"] == "Pa s**-1"


def test_the_skin_does_not_stand_in_for_the_air(tmp_path, fields):
    air = {key: values for key, values in fields.items() if key[0] != "t"}
    path = write(tmp_path, {**air, ("t", 0): np.full((5, 12), 300.0)})
    with pytest.raises(DataError, match="has no 't' on pressure levels"):
        read_weather(path)


def test_levels_are_those_that_all_variables_have(tmp_path, fields):
    del fields["r", 300], fields["w", 1000], fields["w", 300]
    cube = read_weather(write(tmp_path, fields))
    np.testing.assert_array_equal(cube.data["level"], [850.0, 500.0])
    assert cube.lost_levels_hpa["t"] == (1000.0, 300.0)
    assert cube.lost_levels_hpa["r"] == (1000.0,)
    assert cube.lost_levels_hpa["w"] == ()


def test_an_optional_variable_takes_no_level_away(tmp_path, fields):
    fields["clwmr", 850] = np.full((5, 12), 1e-4)
    cube = read_weather(write(tmp_path, fields))
    assert cube.data["level"].size == 4
    np.testing.assert_allclose(cube.data["clwmr"].sel(level=850.0), 1e-4, rtol=1e-4)
    assert np.isnan(cube.data["clwmr"].sel(level=500.0)).all()


@pytest.mark.parametrize("name", NAMES)
def test_a_missing_variable_is_named(tmp_path, fields, name):
    rest = {key: values for key, values in fields.items() if key[0] != name}
    with pytest.raises(DataError, match=f"has no '{name}' on pressure levels"):
        read_weather(write(tmp_path, rest))


def test_vertical_velocity_in_metres_per_second_is_refused(tmp_path, fields):
    swapped = {("wz" if n == "w" else n, z): v for (n, z), v in fields.items()}
    with pytest.raises(DataError, match=r"m/s \('wz'\) and not in Pa/s"):
        read_weather(write(tmp_path, swapped))


def test_too_few_common_levels_are_refused(tmp_path, fields):
    few = {k: v for k, v in fields.items() if k[0] != "r" or k[1] == 500}
    with pytest.raises(DataError, match="fewer than two pressure levels"):
        read_weather(write(tmp_path, few))


def test_masked_points_are_nan_and_nowhere_else(tmp_path, fields):
    fields["t", 850][1, 2] = np.nan
    # not the number that once stood for missing
    fields["gh", 300][0, 0] = 9999.0
    cube = read_weather(write(tmp_path, fields))
    missing = np.isnan(cube.data["t"].to_numpy())
    assert missing[1, 3, 2]
    assert missing.sum() == 1
    assert np.isfinite(cube.data["gh"]).all()


def test_a_variable_that_is_all_masked_is_refused(tmp_path, fields):
    for level in LEVELS:
        fields["r", level][:] = np.nan
    with pytest.raises(DataError, match="'r' all masked"):
        read_weather(write(tmp_path, fields))


def test_several_times_are_refused(tmp_path, fields):
    first = write(tmp_path, fields, time=TIME).read_bytes()
    path = write(tmp_path, fields, time=TIME + timedelta(hours=6))
    path.write_bytes(first + path.read_bytes())
    with pytest.raises(DataError, match="for several values of time"):
        read_weather(path)


def test_variables_of_different_times_or_grids_are_refused(tmp_path, fields):
    winds = {key: values for key, values in fields.items() if key[0] in "uv"}
    rest = {key: values for key, values in fields.items() if key[0] not in "uv"}
    first = write(tmp_path, rest, time=TIME).read_bytes()
    path = write(tmp_path, winds, time=TIME + timedelta(hours=6))
    path.write_bytes(first + path.read_bytes())
    with pytest.raises(DataError, match="holds several times"):
        read_weather(path)
    path = write(tmp_path, winds, time=TIME, latitude_deg=LATITUDE / 2)
    path.write_bytes(first + path.read_bytes())
    with pytest.raises(DataError, match="variables on different grids"):
        read_weather(path)


def test_a_single_meridian_is_refused(tmp_path):
    fields = fields_of((5, 1))
    one = {"Ni": 1, "longitudeOfLastGridPointInDegrees": 0.0}
    path = write(tmp_path, fields, extra=one)
    with pytest.raises(DataError, match="single latitude or longitude"):
        read_weather(path)


def test_files_that_cannot_be_read_are_named(tmp_path, fields):
    with pytest.raises(DataError, match="absent is not a file"):
        read_weather(tmp_path / "absent")
    (tmp_path / "text").write_text("not a GRIB file")
    with pytest.raises(DataError, match="text is not a GRIB file"):
        read_weather(tmp_path / "text")
    path = write(tmp_path, fields)
    whole = path.read_bytes()
    path.write_bytes(whole[:-100])
    with pytest.raises(DataError, match=r"weather\.grib is truncated"):
        read_weather(path)
    path.write_bytes(whole[:200] + whole[300:])
    with pytest.raises(DataError, match=r"weather\.grib is damaged: its message 1, at"):
        read_weather(path)


def test_grids_of_another_kind_are_refused(tmp_path, fields):
    path = write(tmp_path, fields, extra={"gridType": "rotated_ll"})
    with pytest.raises(DataError, match=r"weather\.grib.*'rotated_ll' grid"):
        read_weather(path)


# -- at an altitude


def test_altitude_is_interpolated_in_height_column_by_column(tmp_path, fields):
    cube = read_weather(write(tmp_path, fields))
    found = cube.at_altitude(3000.0)
    assert set(found.data_vars) == {"u", "v", "w", "r", "t"}
    height, values = cube.data["gh"].to_numpy(), cube.data["t"].to_numpy()
    for row, column in [(0, 0), (2, 5), (4, 11)]:
        expected = np.interp(3000.0, height[:, row, column], values[:, row, column])
        assert found["t"][row, column] == pytest.approx(expected, rel=1e-5)


def test_altitude_out_of_reach_is_nan(tmp_path, fields):
    cube = read_weather(write(tmp_path, fields))
    assert np.isnan(cube.at_altitude(50.0)["t"]).all()
    assert np.isnan(cube.at_altitude(9300.0)["t"]).all()
    assert np.isfinite(cube.at_altitude(9100.0)["t"]).all()
    assert cube.at_altitude(9100.0)["altitude_m"] == 9100.0


def test_altitude_below_ground_is_nan(tmp_path, fields):
    ground = np.zeros((5, 12))
    ground[0, 0] = 3500.0
    fields["orog", 0] = ground
    found = read_weather(write(tmp_path, fields)).at_altitude(3000.0)
    below = np.isnan(found["t"].to_numpy())
    assert below[4, 0]
    assert below.sum() == 1


def test_altitude_above_levels_masked_under_the_ground(tmp_path, fields):
    for name in NAMES:
        fields[name, 1000][0, 0] = np.nan
    found = read_weather(write(tmp_path, fields)).at_altitude(3000.0)
    assert np.isfinite(found["t"]).all()


# -- on a Lambert map


def true_north(latitude, longitude):
    """By differences along the rows: the angle from true north to the y axis."""
    east = np.gradient(longitude, axis=0) * np.cos(np.radians(latitude))
    north = np.gradient(latitude, axis=0)
    return np.arctan2(east, north)


@pytest.mark.parametrize("cuts", [(25.0, 25.0), (25.0, 60.0)])
def test_winds_on_a_lambert_map_are_turned_to_earth(tmp_path, cuts):
    shape = (30, 40)
    fields = fields_of(shape)
    for level in LEVELS:
        fields["u", level][:], fields["v", level][:] = 0.0, 10.0
    path = write_lambert_grib(tmp_path / "l.grib", fields, standard_latitudes_deg=cuts)
    cube = read_weather(path)
    assert cube.data["u"].dims == ("level", "y", "x")
    angle = true_north(
        cube.data["latitude"].to_numpy(), cube.data["longitude"].to_numpy()
    )
    inside = (slice(1, -1), slice(1, -1))
    u, v = cube.data["u"].to_numpy()[0], cube.data["v"].to_numpy()[0]
    np.testing.assert_allclose(np.arctan2(u, v)[inside], angle[inside], atol=2e-3)
    np.testing.assert_allclose(np.hypot(u, v), 10.0, rtol=1e-5)


def test_winds_already_relative_to_earth_are_left(tmp_path):
    fields = fields_of((6, 8))
    path = write_lambert_grib(tmp_path / "l.grib", fields, wind_relative_to_grid=False)
    cube = read_weather(path)
    np.testing.assert_allclose(cube.data["u"][0], fields["u", 1000], rtol=1e-5)
    assert not cube.is_global


@pytest.mark.parametrize("cuts", [(25.0, 25.0), (25.0, 60.0)])
def test_lambert_to_latitude_and_longitude(tmp_path, cuts):
    path = tmp_path / "l.grib"
    fields = fields_of((20, 30))
    write_lambert_grib(path, fields, standard_latitudes_deg=cuts)
    on_map = read_weather(path).data
    # a field that is a plane on the globe, and known everywhere
    plane = on_map["latitude"].to_numpy() + 0.5 * on_map["longitude"].to_numpy()
    for level in LEVELS:
        fields["t", level] = plane
    write_lambert_grib(path, fields, standard_latitudes_deg=cuts)
    cube = read_weather(path).regular(0.5)
    assert cube.projection is None
    assert cube.data["t"].dims == ("level", "latitude", "longitude")
    assert np.all(np.diff(cube.data["latitude"]) == 0.5)
    found = cube.data["t"].to_numpy()[0]
    latitude = cube.data["latitude"].to_numpy()[:, None]
    expected = latitude + 0.5 * cube.data["longitude"].to_numpy()
    inside = np.isfinite(found)
    assert 0.5 < inside.mean() < 1.0
    np.testing.assert_allclose(found[inside], expected[inside], atol=0.03)
    assert cube.regular(1.0) is cube


# -- in time


def test_weather_of_another_time_is_refused(tmp_path, fields):
    cube = read_weather(write(tmp_path, fields, time=TIME))
    check_time(TIME + timedelta(hours=2.9), cube)
    check_time(TIME - timedelta(hours=20), cube, allowed_hours=24.0)
    with pytest.raises(
        DataError,
        match=r"2019-10-27 18:00 UTC, 4\.0 hours from the imagery of 2019-10-27 22:00",
    ):
        check_time(TIME + timedelta(hours=4), cube)


@pytest.fixture
def series(tmp_path, fields):
    """Two files, six hours apart, the later without its uppermost level."""
    later = {key: values + 3.0 for key, values in fields.items() if key[1] != 300}
    paths = [tmp_path / "early.grib", tmp_path / "late.grib"]
    axes: Any = {"latitude_deg": LATITUDE, "longitude_deg": LONGITUDE}
    write_grib(paths[0], fields, time=TIME, **axes)
    write_grib(paths[1], later, time=TIME + timedelta(hours=6), **axes)
    return [read_weather(path) for path in paths]


def test_weather_in_time_is_put_in_order(series):
    ordered = WeatherSeries.of(series[::-1])
    assert ordered.times == (TIME, TIME + timedelta(hours=6))
    origin = TIME + timedelta(hours=2)
    np.testing.assert_array_equal(ordered.seconds_from(origin), [-7200.0, 14400.0])
    east, north = ordered.winds(3000.0)
    assert east.shape == north.shape == (2, 5, 12)
    for cube, u, v in zip(series, east, north, strict=True):
        np.testing.assert_array_equal(u, cube.at_altitude(3000.0)["u"])
        np.testing.assert_array_equal(v, cube.at_altitude(3000.0)["v"])


@pytest.mark.parametrize(
    ("hours", "expected"),
    [
        (-5, [(0, 1.0)]),
        (0, [(0, 1.0)]),
        (1.5, [(0, 0.75), (1, 0.25)]),
        (6, [(1, 1.0)]),
        (9, [(1, 1.0)]),
    ],
)
def test_weights_are_linear_between_two_times(series, hours, expected):
    when = TIME + timedelta(hours=hours)
    assert WeatherSeries.of(series).weights(when) == expected


def test_series_that_are_none_are_refused(tmp_path, series):
    with pytest.raises(DataError, match="needs one file at least"):
        WeatherSeries.of([])
    with pytest.raises(
        DataError, match=r"early\.grib and .*early\.grib are both valid"
    ):
        WeatherSeries.of([series[0], series[0]])
    coarse = write(tmp_path, fields_of((3, 12)), latitude_deg=LATITUDE[::2])
    with pytest.raises(DataError, match=r"weather\.grib and .* on different grids"):
        WeatherSeries.of([read_weather(coarse), series[1]])
