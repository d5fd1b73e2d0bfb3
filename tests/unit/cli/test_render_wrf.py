"""`cloudjax render SENSOR --wrf`: what reaches the renderer, and what is refused."""

import numpy as np
import pytest

from cloudjax import Shadows
from cloudjax_data import open_wrf, read_wrf
from cloudjax_scenes.model_columns import depth_columns
from cloudjax_scenes.model_scene import ModelWorld
from tests.commands import run, sentence_of
from tests.generated_wrf import COLUMNS, LEVELS, ROWS, write_wrf


SENSOR = "abi-meso-10km", "--centre", "20,-80", "--bands", "2,13"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wrf")
    ice = np.zeros((LEVELS, ROWS, COLUMNS))
    ice[3] = 2e-5
    times = ["2005-08-28_12:00:00", "2005-08-28_18:00:00"]
    write_wrf(folder / "wrfout", times=times, QICE=ice, CLDFRA=0.5 + 0 * ice)
    write_wrf(folder / "clear", QCLOUD=0 * ice)
    write_wrf(folder / "bare", without=["PB"])
    return folder


def _render(folder, name, *options):
    wrf = "--wrf", folder / name
    return run("render", *SENSOR, *wrf, "-o", folder / "out.nc", *options)


def test_the_model_s_clouds_reach_the_renderer(folder, asked):
    given = "--time", "2005-08-28T18:00", "--steps", 7, "--shadows", 3
    result = _render(folder, "wrfout", "--place", "20,-80", *given)
    assert result.exit_code == 0, (result.output, result.exception)
    ((world, _, time),) = asked
    assert time.hour == 18
    assert (world.steps, world.shadows, world.light) == (7, 3, "physical")
    assert list(world.classes) == ["water", "ice"]
    assert world.sources == ("wrfout",)


REFUSED = {
    "no place": ("wrfout", (), "without a map"),
    "no such time": (
        "wrfout",
        ("--place", "20,-80", "--time", "2005-08-28T13:00"),
        "its 2 times are 2005-08-28_12:00:00 to 2005-08-28_18:00:00",
    ),
    "clear": ("clear", ("--place", "20,-80"), "has no cloud at 2005-08-28 12:00"),
    "variable": ("bare", ("--place", "20,-80"), "has no PB"),
    "seed": ("wrfout", ("--seed", "3"), "leave out --seed"),
    "frames": ("wrfout", ("--frames", "2"), "leave out --frames"),
    "both": ("wrfout", ("--weather", "x.grib2"), "give one"),
    "none": ("none", (), "is not a file"),
}


@pytest.mark.parametrize(("name", "options", "said"), REFUSED.values(), ids=REFUSED)
def test_what_does_not_serve_ends_in_a_sentence(folder, name, options, said):
    assert said in sentence_of(_render(folder, name, *options))
    assert not (folder / "out.nc").exists()


@pytest.fixture(scope="module")
def world(folder):
    columns = read_wrf(open_wrf(folder / "wrfout").frames[0], centre=(20.0, -80.0))
    return ModelWorld(columns)


def test_layers_hold_all_of_the_model_s_optical_depth(world):
    depth = sum(np.asarray(cloud.column_depth()) for cloud in world.classes.values())
    expected = depth_columns(world.columns).column_depth
    np.testing.assert_allclose(depth, expected, rtol=1e-5)
    assert world.classes["water"].nodes == 4


def test_the_air_is_the_model_s_up_to_its_top(world):
    from cloudjax.air.gases import LEVELS_M, standard_humidity

    columns, place = world.columns, (np.array([20.0]), np.array([-80.0]))
    kelvin, humidity = (field[0] for field in world.profiles(*place))
    heights = columns.heights_m[1:, 2, 3] - 500
    within = (heights[0] < LEVELS_M) & (heights[-1] > LEVELS_M)
    expected = np.interp(LEVELS_M, heights, columns.temperature_k[:, 2, 3])
    np.testing.assert_allclose(kelvin[within], expected[within], atol=0.1)
    np.testing.assert_allclose(humidity[within], 0.01 / 1.01, rtol=1e-4)
    far = LEVELS_M > 40e3
    np.testing.assert_allclose(humidity[far], standard_humidity()[far], atol=1e-5)
    ground = world.surface.cover(*place).temperature_k[0]
    assert ground == pytest.approx(columns.temperature_k[0, 2, 3], abs=0.1)


def test_the_sea_lies_in_the_model_s_wind(world):
    """Of 10 and 5 m/s, 500 m up; waves of 0.2 mm, by a logarithm (docs/theory)."""
    expected = np.hypot(10, 5) * np.log(10 / 2e-4) / np.log(500 / 2e-4)
    np.testing.assert_allclose(world.surface.wind_m_s, expected, rtol=1e-3)


def test_a_scene_has_the_bands_and_the_light_that_are_asked(world):
    from cloudjax import bands_named

    scene = world.scene(bands_named(2, 13), world.columns.time)
    assert scene.bands == (2, 13)
    assert [layer.name for layer in scene.layers] == ["water", "ice"]
    assert isinstance(Shadows(3), type(ModelWorld(world.columns, shadows=3).scene(
        bands_named(2), world.columns.time).shadows))  # fmt: skip
