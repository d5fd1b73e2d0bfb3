"""Weather that does not hold the scene is refused, or used where it does, and said."""

import re
from dataclasses import replace
from datetime import timedelta

import numpy as np
import pytest

from cloudjax.air.gases import LEVELS_M
from cloudjax_data import (
    DataError,
    WeatherSeries,
    cf_attributes,
    open_folder,
    read_weather,
)
from cloudjax_fit.fit_inputs import read_analysis
from cloudjax_scenes import Analysis, SceneFromImagery
from cloudjax_scenes.weather_cover import held_share
from cloudjax_scenes.weather_scene import World, open_world
from tests.commands import run
from tests.generated import SCAN_START
from tests.generated_grib import write_grib, write_lambert_grib
from tests.scenes import write_scene
from tests.small_fits import small_class, small_imagery


pyproj = pytest.importorskip("pyproj")

HEIGHT = {1000: 110.0, 850: 1500.0, 700: 3000.0, 500: 5600.0, 300: 9200.0, 100: 16500.0}
GLOBE = np.arange(90.0, -91.0, -10.0), np.arange(0.0, 360.0, 10.0)
EUROPE = np.arange(60.0, 29.0, -2.0), np.arange(0.0, 41.0, 2.0)


def write(file, axes, time=SCAN_START, levels=HEIGHT, **given):
    """Still air of 60 % whose temperature rises by 0.2 K per degree of longitude."""
    latitude, longitude = axes
    shape = latitude.size, longitude.size
    usual = {"u": 5.0, "v": 1.0, "w": 0.0, "r": 60.0}
    usual["t"] = 200.0 + 0.2 * (longitude % 360)
    fields = {
        (name, level): np.array(np.broadcast_to(value, shape), float)
        for level in levels
        for name, value in ({"gh": HEIGHT[level]} | usual | given).items()
    }
    return write_grib(
        file, fields, latitude_deg=latitude, longitude_deg=longitude, time=time
    )


def pixels_by_pyproj(grid):
    """Latitudes and longitudes of all pixels, none of which is beyond the Earth."""
    height = grid.perspective_height_m
    to_degrees = pyproj.Proj(pyproj.CRS.from_cf(cf_attributes(grid)))
    x, y = np.meshgrid(grid.x_rad * height, grid.y_rad * height)
    longitude, latitude = to_degrees(x, y, inverse=True)
    assert np.isfinite(latitude).all()
    return latitude, longitude % 360


def western_part(imagery):
    """Axes that end in the middle of a scene, at a whole tenth of a degree."""
    latitude, longitude = pixels_by_pyproj(imagery.grid)
    edge = round(float(longitude.mean()), 1)
    axes = (
        np.round(latitude.mean()) + np.arange(10.0, -11.0, -0.5),
        np.round(edge - 0.5 * np.arange(40)[::-1], 1),
    )
    return axes, latitude, longitude, edge


# -- which places a grid holds


@pytest.mark.parametrize("edition", [1, 2])
def test_places_of_a_region_across_the_date_line(tmp_path, edition):
    axes = np.arange(60.0, 29.0, -2.0), np.arange(170.0, 200.0, 2.0)
    latitude, longitude = axes
    shape = latitude.size, longitude.size
    fields = {
        (name, level): np.full(shape, value + HEIGHT[level] * (name == "gh"))
        for level in (850, 500)
        for name, value in {"u": 1, "v": 1, "w": 1, "r": 9, "t": 270, "gh": 0}.items()
    }
    cube = read_weather(
        write_grib(
            tmp_path / "w.grib",
            fields,
            latitude_deg=latitude,
            longitude_deg=(longitude + 180) % 360 - 180 if edition == 1 else longitude,
            edition=edition,
        )
    )
    inside = [(30, 170), (60, 198), (45, -175), (45, 185), (31, -162)]
    outside = [(29.9, 180), (60.1, 180), (45, 169.9), (45, -161.9), (45, 0), (-45, 180)]
    φ, λ = np.array(inside + outside, float).T
    expected = [True] * len(inside) + [False] * len(outside)
    assert cube.holds(φ, λ).tolist() == expected


def test_places_of_the_globe(tmp_path):
    cube = read_weather(write(tmp_path / "w.grib", GLOBE))
    φ, λ = np.array([90.0, -90.0, 0.0, 3.0]), np.array([0.0, 77.0, 359.9, -180.0])
    assert cube.holds(φ, λ).all()


def test_places_next_to_masked_columns_are_not_held(tmp_path):
    hole = np.full((GLOBE[0].size, GLOBE[1].size), 5.0)
    hole[9, 0] = np.nan
    cube = read_weather(write(tmp_path / "w.grib", GLOBE, u=hole))
    φ, λ = np.array([0.0, 5.0, 0.0, 0.0, 10.0]), np.array([0.0, 355.0, 9.0, 10.0, 0.0])
    assert cube.holds(φ, λ).tolist() == [False, False, False, True, True]


def test_places_of_a_lambert_map_are_those_of_pyproj(tmp_path):
    shape = (12, 20)
    fields = {
        (name, level): np.full(shape, value + HEIGHT[level] * (name == "gh"))
        for level in (850, 500)
        for name, value in {"u": 1, "v": 1, "w": 1, "r": 9, "t": 270, "gh": 0}.items()
    }
    cube = read_weather(write_lambert_grib(tmp_path / "l.grib", fields))
    proj = pyproj.Proj(proj="lcc", R=6371229.0, lon_0=265.0, lat_1=25.0, lat_2=60.0)
    x0, y0 = proj(230.0, 20.0)
    φ, λ = np.meshgrid(np.arange(5.0, 70.0, 3.3), np.arange(200.0, 320.0, 3.3))
    x, y = proj(λ, φ)
    column, row = (x - x0) / 2e5, (y - y0) / 2e5
    expected = (row >= 0) & (row <= 11) & (column >= 0) & (column <= 19)
    assert 0.1 < expected.mean() < 0.9
    np.testing.assert_array_equal(cube.holds(φ, λ), expected)


# -- scenes


def test_weather_of_another_place_is_refused(tmp_path):
    """0 to 40E beside California was called near enough, and its edges held."""
    imagery = small_imagery()
    cube = read_weather(write(tmp_path / "europe.grib", EUROPE))
    sentence = (
        r"europe\.grib covers latitudes 30 to 60 and longitudes 0 to 40, and nothing of"
        " the scene"
    )
    with pytest.raises(DataError, match=sentence):
        held_share(cube, imagery.grid)
    with pytest.raises(DataError, match=sentence):
        Analysis(cube).air(imagery)


def test_air_is_the_mean_of_what_is_held(tmp_path):
    imagery = small_imagery()
    axes, _, longitude, edge = western_part(imagery)
    analysis = Analysis(read_weather(write(tmp_path / "west.grib", axes)))
    held = longitude <= edge
    assert 0.3 < held.mean() < 0.7
    share = held_share(analysis.cube, imagery.grid)
    assert share == pytest.approx(held.mean(), abs=1e-9)
    kelvin = np.asarray(analysis.air(imagery)[0](np.array([5000.0])))
    expected = 200.0 + 0.2 * longitude[held].mean()
    assert kelvin[0] == pytest.approx(expected, abs=2e-3)
    wrong = 200.0 + 0.2 * np.minimum(longitude, edge).mean()
    assert abs(wrong - expected) > 0.01
    made_of = SceneFromImagery(imagery, analysis, known={"low": small_class()})
    percent = np.floor(1000 * held.mean()) / 10
    assert f"west.grib holds {percent:g} % of the scene" in made_of.notes[0]


def test_weather_that_holds_all_of_the_scene_is_not_remarked_upon(tmp_path):
    analysis = Analysis(read_weather(write(tmp_path / "w.grib", GLOBE)))
    assert analysis.notes(small_imagery()) == []


def test_a_mask_is_put_where_the_weather_is_known(tmp_path):
    imagery = small_imagery(0.8)
    axes, _, _, edge = western_part(imagery)
    analysis = Analysis(read_weather(write(tmp_path / "west.grib", axes)))
    anywhere = replace(
        small_class().conditions,
        vertical_wind_min_pa_s=-np.inf,
        vertical_wind_max_pa_s=np.inf,
        temperature_min_k=0.0,
    )
    known = {"low": small_class(conditions=anywhere)}
    found = analysis.masked(imagery, known).fractions["low"]
    west = imagery.longitude_deg % 360 <= edge
    assert 0 < west.sum() < west.size
    assert (found[:, ~west] == 0.8).all()
    # Sundqvist: 1 - sqrt((1 - 0.6)/(1 - 0.3)), softened near saturation.
    expected = 1 - np.sqrt(0.4 / 0.7)
    np.testing.assert_allclose(found[:, west], expected, atol=0.02)


def test_a_level_that_is_masked_in_a_column_is_bridged(tmp_path):
    """At 500 hPa there is no temperature at one place: 700 and 300 hPa tell it."""
    levels = {level: 290.0 - 0.0065 * height for level, height in HEIGHT.items()}
    latitude, longitude = GLOBE
    shape = latitude.size, longitude.size
    usual = {"u": 5.0, "v": 1.0, "w": 0.0, "r": 60.0}
    fields = {
        (name, level): np.full(shape, value)
        for level, height in HEIGHT.items()
        for name, value in (usual | {"gh": height, "t": levels[level]}).items()
    }
    fields["t", 500][4, 7] = np.nan
    file = write_grib(
        tmp_path / "w.grib", fields, latitude_deg=latitude, longitude_deg=longitude
    )
    cube = read_weather(file)
    found = cube.at_altitude(5000.0)
    expected = np.interp(5000.0, [3000.0, 9200.0], [levels[700], levels[300]])
    assert float(found["t"][14, 7]) == pytest.approx(expected, abs=1e-2)
    assert np.isfinite(found["t"]).all()
    assert np.isfinite(found["u"]).all()
    kelvin, _ = Analysis(cube).air(small_imagery())
    assert LEVELS_M.size == np.asarray(kelvin(LEVELS_M)).size


# -- worlds of weather alone


@pytest.mark.parametrize(
    "axes", [EUROPE, (np.arange(60.0, -61.0, -10.0), GLOBE[1])], ids=["box", "belt"]
)
def test_a_world_must_be_whole(tmp_path, axes):
    cube = read_weather(write(tmp_path / "part.grib", axes))
    assert not cube.is_global
    with pytest.raises(DataError, match=r"part\.grib covers a region only"):
        World(WeatherSeries.of([cube]))


def test_a_world_with_a_hole_is_refused(tmp_path):
    hole = np.full((GLOBE[0].size, GLOBE[1].size), 5.0)
    hole[5:9, 3:12] = np.nan
    cube = read_weather(write(tmp_path / "hole.grib", GLOBE, v=hole))
    share = 100 * 36 / hole.size
    with pytest.raises(DataError, match=rf"hole\.grib has no values at {share:.2f}%"):
        World(WeatherSeries.of([cube]))


def test_later_weather_must_reach_as_high_as_the_first(tmp_path):
    first = write(tmp_path / "first.grib", GLOBE)
    later = write(
        tmp_path / "low.grib", GLOBE, SCAN_START + timedelta(hours=3), (1000, 850, 700)
    )
    with pytest.raises(DataError, match=r"low\.grib has nothing at 6000 m"):
        open_world([first, later], decision="table1")


# -- scene folders


@pytest.fixture
def scene_folder(tmp_path):
    return write_scene(tmp_path / "scene", (13,))


def test_the_analysis_that_holds_the_scene_goes_before_the_nearest(scene_folder):
    write(scene_folder / "a.grib", EUROPE)
    write(scene_folder / "b.grib", GLOBE, SCAN_START + timedelta(hours=2))
    (scene_folder / "c.grib").write_bytes((scene_folder / "a.grib").read_bytes()[:-9])
    write(scene_folder / "d.grib", GLOBE, SCAN_START + timedelta(hours=9))
    folder = open_folder(scene_folder)
    analysis = read_analysis(folder, folder.read((13,)))
    assert analysis is not None
    assert analysis.cube.path.name == "b.grib"
    said = " ".join(analysis.passed_over)
    for sentence in (
        r"a\.grib covers latitudes 30 to 60",
        r"c\.grib is truncated",
        r"d\.grib is valid at .* 9\.0 hours from the imagery",
    ):
        assert re.search(sentence, said)


def test_a_folder_whose_only_weather_is_elsewhere(scene_folder):
    write(scene_folder / "europe.grib", EUROPE)
    folder = open_folder(scene_folder)
    with pytest.raises(DataError, match="nothing of the scene"):
        read_analysis(folder, folder.read((13,)))
    said = run("info", scene_folder)
    assert said.exit_code == 0, said.output
    assert "nothing of the scene" in " ".join(said.output.split())


def test_info_says_how_much_of_the_scene_is_held(scene_folder):
    grid = open_folder(scene_folder).read((13,)).grid
    axes, _, longitude, edge = western_part(replace(small_imagery(), grid=grid))
    write(scene_folder / "west.grib", axes)
    said = " ".join(run("info", scene_folder).output.split())
    shares = re.findall(
        r"near enough, and holds ([0-9.]+) % of the scene"
        r"|west\.grib holds ([0-9.]+) % of the scene: the air is the mean",
        said,
    )
    # A pixel of 2304 may be at the edge.
    percent = 100 * (longitude <= edge).mean()
    assert len(shares) == 2
    for one, other in shares:
        assert float(one or other) == pytest.approx(percent, abs=0.15)
