"""WRF output: places, levels, winds, condensate, and files that do not serve."""

from datetime import UTC, datetime

import netCDF4
import numpy as np
import pytest

from cloudjax.geometry.map_projections import (
    AbstractMapProjection,
    ConformalConic,
    LatLonMap,
    Mercator,
)
from cloudjax_data import DataError, open_wrf, read_wrf
from tests.generated_wrf import COLUMNS, LEVELS, ROWS, write_wrf


# A map, the attributes that name it, and a place on it.
MAPS: dict[str, tuple[AbstractMapProjection, dict, tuple[float, float]]] = {
    "lambert": (
        ConformalConic.lambert(30.0, 60.0, -97.0),
        {"MAP_PROJ": 1, "TRUELAT1": 30.0, "TRUELAT2": 60.0, "STAND_LON": -97.0},
        (40.0, -80.0),
    ),
    "polar": (
        ConformalConic.polar_stereographic(-71.0, 20.0),
        {"MAP_PROJ": 2, "TRUELAT1": -71.0, "STAND_LON": 20.0},
        (-80.0, 170.0),
    ),
    "mercator": (
        Mercator(0.0, 10.0),
        {"MAP_PROJ": 3, "TRUELAT1": 10.0, "STAND_LON": 0.0},
        (5.0, 100.0),
    ),
    "latlon": (
        LatLonMap(0.0),
        {"MAP_PROJ": 6, "POLE_LAT": 90.0, "POLE_LON": 0.0, "STAND_LON": 0.0},
        (50.0, 10.0),
    ),
    # The pole of WRF's turned globe is at 180° less STAND_LON.
    "turned": (
        LatLonMap(180.0, 40.0, 190.0),
        {"MAP_PROJ": 6, "POLE_LAT": 40.0, "POLE_LON": 180.0, "STAND_LON": -10.0},
        (48.0, 11.0),
    ),
}


def _on_map(own: AbstractMapProjection, middle):
    x, y = own.project(*(np.array([degrees]) for degrees in middle))
    rows, columns = np.arange(ROWS)[:, None], np.arange(COLUMNS)[None]
    return own.places(*np.broadcast_arrays(x + 3000.0 * columns, y + 3000.0 * rows))


def _only(path, **options):
    (frame,) = open_wrf(path).frames
    return read_wrf(frame, **options)


@pytest.mark.parametrize(("own", "attributes", "middle"), MAPS.values(), ids=MAPS)
def test_columns_of_every_map_are_where_the_file_says(
    tmp_path, own, attributes, middle
):
    """Files in single precision, and with sizes of another domain in the attributes."""
    latitude, longitude = _on_map(own, middle)
    sizes = {"DX": 9e3, "DY": 9e3, "CEN_LAT": 0.0, "CEN_LON": 0.0}
    path = write_wrf(tmp_path / "wrfout", latitude, longitude, attributes | sizes)
    grid = _only(path).grid
    np.testing.assert_allclose(grid.spacing_m, 3000.0, rtol=2e-3)
    row, column = grid.index(latitude, longitude)
    expected = grid.mesh()
    np.testing.assert_allclose([row, column], expected, atol=5e-3)
    found = grid.places(*expected)
    np.testing.assert_allclose(found[0], latitude, atol=1e-4)
    np.testing.assert_allclose((found[1] - longitude + 180) % 360, 180, atol=1e-4)


@pytest.mark.parametrize(("own", "attributes", "middle"), MAPS.values(), ids=MAPS)
def test_winds_turn_to_true_north(tmp_path, own, attributes, middle):
    latitude, longitude = _on_map(own, middle)
    columns = _only(write_wrf(tmp_path / "wrfout", latitude, longitude, attributes))
    assert columns.winds_m_s is not None
    east, north, up = (wind[0] for wind in columns.winds_m_s)
    # 10 m/s along x and 5 along y for a second of the map, on the globe.
    x, y = own.project(latitude, longitude)
    φ, λ = own.places(x + 10.0, y + 5.0)
    away = np.radians((λ - longitude + 180) % 360 - 180) * np.cos(np.radians(latitude))
    bearing = np.arctan2(away, np.radians(φ - latitude))
    np.testing.assert_allclose(np.hypot(east, north), np.hypot(10, 5), rtol=1e-6)
    # On latitudes and longitudes the map's metres are not those of the ground.
    if not isinstance(own, LatLonMap):
        np.testing.assert_allclose(np.arctan2(east, north), bearing, atol=1e-3)
    np.testing.assert_allclose(up, 1.0)


def test_levels_follow_the_ground_and_water_is_per_volume_of_dry_air(tmp_path):
    ground = np.linspace(0, 900, ROWS)[:, None] + np.zeros(COLUMNS)
    columns = _only(write_wrf(tmp_path / "ideal", ground_m=ground), centre=(20.0, 10.0))
    ends = ground + 1000.0 * np.arange(LEVELS + 1)[:, None, None]
    np.testing.assert_allclose(columns.heights_m, ends, atol=0.1)
    pressure = 1e5 * np.exp(-(ends[1:] + ends[:-1]) / 16000)
    np.testing.assert_allclose(columns.pressure_pa, pressure, rtol=1e-6)
    kelvin = 300 * (pressure / 1e5) ** (2 / 7)
    np.testing.assert_allclose(columns.temperature_k, kelvin, rtol=1e-6)
    dry = pressure / (287 * kelvin * (1 + 0.01 * 461.6 / 287))
    (water,) = columns.condensate
    expected = 1e-4 * (1 + np.arange(ROWS)[:, None] + 10 * np.arange(COLUMNS))
    np.testing.assert_allclose(
        water.content_g_m3[1], 1e3 * dry[1] * expected, rtol=1e-5
    )
    assert water.phase == "water"
    assert columns.specific_humidity[0, 0, 0] == pytest.approx(0.01 / 1.01)
    assert columns.cloud_fraction is None


def test_an_ideal_run_stands_about_its_centre(tmp_path):
    grid = _only(write_wrf(tmp_path / "ideal"), centre=(20.0, 10.0)).grid
    row, column = grid.index(np.array([20.0]), np.array([10.0]))
    np.testing.assert_allclose([row[0], column[0]], [(ROWS - 1) / 2, (COLUMNS - 1) / 2])
    np.testing.assert_allclose(grid.area_m2(), 9e6, rtol=0.01)


def test_radii_are_the_files_or_follow_from_numbers(tmp_path):
    levels = np.ones((LEVELS, ROWS, COLUMNS))
    path = write_wrf(
        tmp_path / "radii",
        QICE=1e-5 * levels,
        QNICE=1e5 * levels,
        RE_CLOUD=7e-6 * levels,
        CLDFRA=0.3 * levels,
    )
    columns = _only(path, centre=(0.0, 0.0))
    water, ice = columns.condensate
    some = water.content_g_m3 > 0
    np.testing.assert_allclose(water.effective_radius_um[some], 7.0, rtol=1e-6)
    # Of spheres of 890 kg/m³ that weigh 1e-10 kg, in an exponential distribution.
    volume_um = 1e6 * (3 * 1e-10 / (4 * np.pi * 890)) ** (1 / 3)
    np.testing.assert_allclose(ice.effective_radius_um, 1.651 * volume_um, rtol=1e-3)
    assert columns.cloud_fraction is not None
    np.testing.assert_allclose(columns.cloud_fraction, 0.3)


def test_species_of_a_phase_join_by_mass_and_area(tmp_path):
    levels = np.ones((LEVELS, ROWS, COLUMNS))
    path = write_wrf(tmp_path / "rain", QCLOUD=1e-4 * levels, QRAIN=1e-3 * levels)
    (water,) = _only(path, centre=(0.0, 0.0)).condensate
    expected = 1.1e-3 / (1e-4 / 10 + 1e-3 / 500)
    np.testing.assert_allclose(water.effective_radius_um, expected, rtol=1e-6)


def test_the_scheme_of_three_species_has_ice_where_it_freezes(tmp_path):
    columns = _only(
        write_wrf(tmp_path / "wsm3", None, None, {"MP_PHYSICS": 3}), centre=(0.0, 0.0)
    )
    water, ice = columns.condensate
    # The cloud is at 1.5 km, warmer than freezing, or with 40 K less colder.
    assert (water.phase, ice.phase) == ("water", "ice")
    assert ice.content_g_m3.max() == 0 < water.content_g_m3.max()
    cold = np.full((LEVELS, ROWS, COLUMNS), -40.0)
    path = write_wrf(tmp_path / "cold", None, None, {"MP_PHYSICS": 3}, T=cold)
    water, ice = _only(path, centre=(0.0, 0.0)).condensate
    assert water.content_g_m3.max() == 0 < ice.content_g_m3.max()
    np.testing.assert_allclose(ice.effective_radius_um[1], 30.0)


def test_times_of_several_files_are_in_order(tmp_path):
    late = write_wrf(tmp_path / "b", times=["2005-08-28_18:00:00"])
    early = write_wrf(
        tmp_path / "a", times=["2005-08-28_12:00:00", "2005-08-28_15:00:00"]
    )
    run = open_wrf([late, early])
    assert [time.hour for time in run.times] == [12, 15, 18]
    frame = run.at(datetime(2005, 8, 28, 15, tzinfo=UTC))
    assert (frame.path, frame.number) == (early, 1)
    assert run.at().time.hour == 12


def test_minutes_serve_where_there_are_no_stamps(tmp_path):
    path = write_wrf(
        tmp_path / "minutes",
        attributes={"SIMULATION_START_DATE": "2005-08-28_00:00:00"},
        without=["Times"],
        XTIME=np.array(90.0),
    )
    assert open_wrf(path).times == (datetime(2005, 8, 28, 1, 30, tzinfo=UTC),)


def _spoilt(path, name, value):
    with netCDF4.Dataset(path, "a") as file:
        file[name][0, 1, 2, 3] = value
    return path


def _shifted(own, middle):
    latitude, longitude = _on_map(own, middle)
    return latitude, longitude + np.linspace(0, 0.05, COLUMNS) ** 2 * 100


LAMBERT, _ATTRIBUTES, _MIDDLE = MAPS["lambert"]
_FLAT = np.ones((LEVELS + 1, ROWS, COLUMNS))
# What is wrong, and what the sentence says of it.
FAULTS = {
    "variables": (
        lambda path: write_wrf(path, without=["PHB", "T"]),
        "has no PHB, T",
    ),
    "condensate": (lambda path: write_wrf(path, without=["QCLOUD"]), "no condensate"),
    "NaN": (lambda path: _spoilt(write_wrf(path), "P", np.nan), "1 points of P"),
    "fill": (
        lambda path: _spoilt(write_wrf(path), "QCLOUD", netCDF4.default_fillvals["f4"]),
        "QCLOUD",
    ),
    "levels": (
        lambda path: write_wrf(
            path, PHB=np.zeros((LEVELS + 1, ROWS, COLUMNS)), PH=_FLAT
        ),
        "do not rise",
    ),
    "no map": (
        lambda path: write_wrf(path, *_on_map(LAMBERT, _MIDDLE), {"MAP_PROJ": 1}),
        "TRUELAT1",
    ),
    "another map": (
        lambda path: write_wrf(path, *_on_map(LAMBERT, _MIDDLE), {"MAP_PROJ": 5}),
        "projection 5",
    ),
    "off the map": (
        lambda path: write_wrf(path, *_shifted(LAMBERT, _MIDDLE), _ATTRIBUTES),
        "beside the map",
    ),
}


@pytest.mark.parametrize(("make", "said"), FAULTS.values(), ids=FAULTS)
def test_what_does_not_serve_is_told_in_a_sentence(tmp_path, make, said):
    path = make(tmp_path / "wrfout")
    on_map = said in ("TRUELAT1", "projection 5", "beside the map")
    centre = None if on_map else (0.0, 0.0)
    with pytest.raises(DataError, match=said):
        _only(path, centre=centre)


def test_an_ideal_run_needs_a_centre_and_others_have_none(tmp_path):
    with pytest.raises(DataError, match="without a map"):
        _only(write_wrf(tmp_path / "ideal"))
    path = write_wrf(tmp_path / "real", *_on_map(LAMBERT, _MIDDLE), _ATTRIBUTES)
    with pytest.raises(DataError, match="leave it out"):
        _only(path, centre=(0.0, 0.0))


def test_times_that_do_not_serve(tmp_path):
    path = write_wrf(tmp_path / "a")
    with pytest.raises(DataError, match="its 1 times are 2005-08-28_12:00:00"):
        open_wrf(path).at(datetime(2005, 8, 28, 13, tzinfo=UTC))
    with pytest.raises(DataError, match="both hold"):
        open_wrf([path, write_wrf(tmp_path / "b")])
    with pytest.raises(DataError, match="which is none"):
        open_wrf(write_wrf(tmp_path / "c", times=["2005-13-28_12:00:00"]))
    with pytest.raises(DataError, match="neither Times nor XTIME"):
        open_wrf(write_wrf(tmp_path / "d", without=["Times"]))
    with pytest.raises(DataError, match="is not a file"):
        open_wrf(tmp_path / "none")


def test_a_clear_time_is_refused_and_a_cut_top_is_told(tmp_path):
    nothing = np.zeros((LEVELS, ROWS, COLUMNS))
    columns = _only(write_wrf(tmp_path / "clear", QCLOUD=nothing), centre=(0.0, 0.0))
    with pytest.raises(DataError, match="has no cloud at 2005-08-28 12:00"):
        columns.require_cloud()
    cut = {"BOTTOM-TOP_GRID_DIMENSION": 30}
    columns = _only(write_wrf(tmp_path / "cut", attributes=cut), centre=(0.0, 0.0))
    columns.require_cloud()
    first, second = columns.cautions()
    assert "5 of the run's 29 levels, up to 570 hPa" in first
    assert "no ice" in second
