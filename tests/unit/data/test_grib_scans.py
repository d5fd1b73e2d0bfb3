"""Grids as they are scanned, against values that are put down point by point.

Latitudes and longitudes of the points are eccodes' own where it has an iterator for
them, pyproj's on the Lambert map, and plain numbers else.
"""

import numpy as np
import pytest

from cloudjax_data import DataError, read_weather
from tests.generated_grib import write_grib, write_lambert_grib


NAMES = ("u", "v", "w", "r", "t", "gh")
HEIGHT = {850: 1500.0, 500: 5600.0}
LATITUDE = np.arange(50.0, 9.0, -10.0)
EAST_ASIA = np.arange(80.0, 146.0, 5.0)
GRIB1, GRIB2 = [(1, flags << 5) for flags in range(8)], [(2, f << 4) for f in range(16)]


def telling(latitude, longitude):
    """A field in which every place has a number of its own."""
    φ, λ = np.meshgrid(np.asarray(latitude), np.asarray(longitude), indexing="ij")
    return 200.0 + φ + 0.1 * (λ % 360)


def all_fields(values):
    fields = {}
    for level, height in HEIGHT.items():
        fields |= {(name, level): values for name in ("u", "v", "t")}
        fields |= {(name, level): values / 5 for name in ("r", "w")}
        fields["gh", level] = height + values
    return fields


def write(folder, latitude, longitude, **options):
    return write_grib(
        folder / "w.grib",
        all_fields(telling(latitude, longitude)),
        latitude_deg=latitude,
        longitude_deg=longitude,
        **options,
    )


def value_at(cube, latitude, longitude):
    data = cube.data["t"].isel(level=0)
    (row,) = np.flatnonzero(np.abs(data["latitude"] - latitude) < 1e-3)
    east = (data["longitude"].to_numpy() - longitude + 180) % 360 - 180
    (column,) = np.flatnonzero(np.abs(east) < 1e-3)
    return float(data[int(row), int(column)])


def points_by_eccodes(path):
    """Latitude, longitude and value of each point of the first message."""
    import eccodes

    with path.open("rb") as stream:
        message = eccodes.codes_grib_new_from_file(stream)
        points = eccodes.codes_grib_get_data(message)
        eccodes.codes_release(message)
    return [(p["lat"], p["lon"], p["value"]) for p in points]


@pytest.mark.parametrize(("edition", "scan"), [*GRIB1, *GRIB2])
def test_every_order_of_points(tmp_path, edition, scan):
    """Rows from the east came out mirrored; 850 hPa at 40N 100E tells the orders."""
    path = write(tmp_path, LATITUDE, EAST_ASIA, edition=edition, scan=scan)
    cube = read_weather(path)
    assert value_at(cube, 40.0, 100.0) == pytest.approx(250.0, abs=1e-2)
    np.testing.assert_allclose(cube.data["latitude"], LATITUDE[::-1], atol=1e-6)
    np.testing.assert_allclose(cube.data["longitude"], EAST_ASIA, atol=1e-6)
    expected = telling(LATITUDE[::-1], EAST_ASIA)
    np.testing.assert_allclose(cube.data["t"][0], expected, atol=1e-2)
    # eccodes 2.50 has no places for lines that go back and forth
    if not scan & 0x10:
        for latitude, longitude, value in points_by_eccodes(path)[:: len(LATITUDE) + 2]:
            found = float(cube.data["u"].sel(latitude=latitude, longitude=longitude)[0])
            assert found == pytest.approx(value, abs=1e-2)


@pytest.mark.parametrize("edition", [1, 2])
def test_fields_of_one_file_in_different_orders(tmp_path, edition):
    path = write(tmp_path, LATITUDE, EAST_ASIA, edition=edition)
    expected = read_weather(path).data
    parts = {
        scan: write(
            tmp_path, LATITUDE, EAST_ASIA, edition=edition, scan=scan
        ).read_bytes()
        for scan in (0, 0xE0)
    }
    size = len(parts[0]) // (len(NAMES) * len(HEIGHT))
    whole = b"".join(
        parts[0xE0 if i % 2 else 0][i * size : (i + 1) * size]
        for i in range(len(NAMES) * len(HEIGHT))
    )
    path.write_bytes(whole)
    found = read_weather(path).data
    for name in NAMES:
        np.testing.assert_allclose(found[name], expected[name], atol=1e-2)


@pytest.mark.parametrize("scan", [0, 0x80])
@pytest.mark.parametrize("first", [0.0, -180.0, 180.0, 17.5])
@pytest.mark.parametrize("edition", [1, 2])
def test_a_global_field_from_any_meridian(tmp_path, edition, first, scan):
    """In edition 1 the last longitude may be minus one step: it is that of the west."""
    step = 2.5
    longitude = first + step * np.arange(144)
    if edition == 2:
        longitude = longitude % 360
    extra = {}
    if edition == 1 and not scan:
        extra["longitudeOfLastGridPointInDegrees"] = (first - step + 180) % 360 - 180
    cube = read_weather(
        write(tmp_path, LATITUDE, longitude, edition=edition, scan=scan, extra=extra)
    )
    np.testing.assert_allclose(cube.data["longitude"], step * np.arange(144), atol=1e-6)
    for at in (0.0, 2.5, 90.0, 182.5, 357.5):
        assert value_at(cube, 20.0, at) == pytest.approx(220 + 0.1 * at, abs=1e-2)


def test_a_last_longitude_at_the_end_of_the_circle(tmp_path):
    """360 where 357.5 is meant: number and increment of the columns say so."""
    longitude = 2.5 * np.arange(144)
    extra = {"longitudeOfLastGridPointInDegrees": 360.0}
    cube = read_weather(write(tmp_path, LATITUDE, longitude, extra=extra))
    assert value_at(cube, 30.0, 357.5) == pytest.approx(230 + 35.75, abs=1e-2)


@pytest.mark.parametrize("edition", [1, 2])
def test_the_first_meridian_twice_is_one(tmp_path, edition):
    longitude = np.append(30.0 * np.arange(12), 360.0)
    cube = read_weather(write(tmp_path, LATITUDE, longitude, edition=edition))
    np.testing.assert_allclose(cube.data["longitude"], longitude[:-1], atol=1e-6)


@pytest.mark.parametrize("scan", [0, 0x80])
@pytest.mark.parametrize("edition", [1, 2])
def test_a_region_across_the_date_line(tmp_path, edition, scan):
    """20 longitudes from 150E to 162.5W."""
    longitude = 150.0 + 2.5 * np.arange(20)
    signed = (longitude + 180) % 360 - 180 if edition == 1 else longitude
    cube = read_weather(write(tmp_path, LATITUDE, signed, edition=edition, scan=scan))
    np.testing.assert_allclose(cube.data["longitude"], longitude, atol=1e-6)
    assert value_at(cube, 20.0, 180.0) == pytest.approx(238.0, abs=1e-2)
    assert value_at(cube, 20.0, -170.0) == pytest.approx(239.0, abs=1e-2)
    assert not cube.is_global


@pytest.mark.parametrize("edition", [1, 2])
def test_an_increment_that_is_not_given(tmp_path, edition):
    missing = {"resolutionAndComponentFlags": 0}
    path = write(tmp_path, LATITUDE, EAST_ASIA, edition=edition, extra=missing)
    cube = read_weather(path)
    assert value_at(cube, 40.0, 100.0) == pytest.approx(250.0, abs=1e-2)


def test_thirds_of_a_degree_that_edition_1_rounds(tmp_path):
    """Steps of 0.333 would end a column short of the circle."""
    longitude = np.arange(1080) / 3
    cube = read_weather(write(tmp_path, LATITUDE, longitude, edition=1))
    np.testing.assert_allclose(cube.data["longitude"], longitude, atol=1e-6)


@pytest.mark.parametrize("edition", [1, 2])
@pytest.mark.parametrize(
    "change",
    [
        {"iScansNegatively": 1},
        {"jScansPositively": 1},
        {"longitudeOfLastGridPointInDegrees": 150.0},
        {"longitudeOfFirstGridPointInDegrees": 85.0},
        {"latitudeOfLastGridPointInDegrees": 0.0},
        {"iDirectionIncrementInDegrees": 2.5},
        {"jDirectionIncrementInDegrees": 11.0},
        {"latitudeOfFirstGridPointInDegrees": 91.0},
    ],
)
def test_numbers_of_a_grid_that_contradict_each_other(tmp_path, edition, change):
    path = write(tmp_path, LATITUDE, EAST_ASIA, edition=edition, extra=change)
    with pytest.raises(DataError, match=r"w\.grib contradicts itself: (5|14) l"):
        read_weather(path)


@pytest.mark.parametrize(("edition", "flags"), [(1, 0x10), (1, 0x08), (2, 0x08)])
def test_flags_that_mean_nothing_known_are_refused(tmp_path, edition, flags):
    path = write(tmp_path, LATITUDE, EAST_ASIA, edition=edition)
    path.write_bytes(path.read_bytes())
    extra = {"scanningMode": flags}
    path = write(tmp_path, LATITUDE, EAST_ASIA, edition=edition, extra=extra)
    with pytest.raises(DataError, match="an order that is not known"):
        read_weather(path)


@pytest.mark.parametrize("scan", [flags << 4 for flags in range(16)])
def test_every_order_of_points_on_a_lambert_map(tmp_path, scan):
    """Places are pyproj's, from the south-west corner; the field tells them apart."""
    pyproj = pytest.importorskip("pyproj")
    rows, columns = 6, 9
    proj = pyproj.Proj(proj="lcc", R=6371229.0, lon_0=265.0, lat_1=25.0, lat_2=60.0)
    x0, y0 = proj(230.0, 20.0)
    x, y = np.meshgrid(x0 + 2e5 * np.arange(columns), y0 + 2e5 * np.arange(rows))
    longitude, latitude = proj(x, y, inverse=True)
    corner = (0 if scan & 0x40 else -1), (-1 if scan & 0x80 else 0)
    first = float(latitude[corner]), float(longitude[corner] % 360)
    values = 200.0 + latitude + 0.1 * (longitude % 360)
    path = write_lambert_grib(
        tmp_path / "l.grib",
        all_fields(values),
        scan=scan,
        first_deg=first,
        wind_relative_to_grid=False,
    )
    data = read_weather(path).data
    np.testing.assert_allclose(data["latitude"], latitude, atol=1e-5)
    np.testing.assert_allclose(data["longitude"] % 360, longitude % 360, atol=1e-5)
    np.testing.assert_allclose(data["t"][0], values, atol=1e-2)


def test_a_lambert_map_of_an_ellipsoid_is_refused(tmp_path):
    path = write_lambert_grib(
        tmp_path / "l.grib",
        all_fields(np.full((6, 9), 50.0)),
        extra={"shapeOfTheEarth": 5},
    )
    with pytest.raises(DataError, match="not on a spherical Earth"):
        read_weather(path)
