"""What is asked of `cloudjax render` reaches what renders."""

import math
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from cloudjax import Shadows
from cloudjax_data.output_lock import alone
from tests.commands import run, sentence_of
from tests.scenes import write_scene
from tests.weather_scenes import MESO, NOON, write_inputs


class Reached(Exception):
    """Raised in place of a render."""


@pytest.fixture(scope="module")
def weather(tmp_path_factory):
    return write_inputs(tmp_path_factory.mktemp("weather"))


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return write_scene(tmp_path_factory.mktemp("scene") / "scene", (1, 13))


@pytest.fixture
def strips(monkeypatch):
    """What the renderer of sensors has been asked, and nothing rendered."""
    asked = []

    def render_strips(world, sensor, bands, time, winds=None, **options):
        asked.append((world, sensor, bands, time, winds, options))
        return []

    monkeypatch.setattr("cloudjax_scenes.image_strips.render_strips", render_strips)
    monkeypatch.setattr("cloudjax_scenes.image_strips.write_strips", lambda *_: None)
    return asked


def _sensor(weather, *options):
    files = "--weather", weather / "gfs.grib2", "--classes", weather / "classes.toml"
    result = run("render", *MESO, *files, "-o", weather / "out.nc", *options)
    assert result.exit_code == 0, (result.output, result.exception)
    return result


def test_a_sensor_s_world_is_that_of_the_options(weather, strips):
    given = "--seed", 7, "--steps", 3, "--bands", "2,13"
    _sensor(weather, *given, "--shadows", 4, "--time", "2019-10-27T19:30")
    ((world, sensor, bands, time, _, _),) = strips
    assert (world.seed, world.steps, world.shadows) == (7, 3, 4)
    assert world.light == "physical"
    assert list(world.classes) == ["low", "high"]
    assert [band.number for band in bands] == [2, 13]
    assert time == datetime(2019, 10, 27, 19, 30, tzinfo=UTC)
    # The middle of 1000 km is the place that has been asked for.
    ground, _ = sensor.view.rays().ground()
    assert np.median(ground.latitude_deg) == pytest.approx(20, abs=0.2)
    assert np.median(ground.longitude_deg) == pytest.approx(-80, abs=0.2)


def test_the_light_and_the_satellite_are_those_of_the_options(weather, strips):
    _sensor(weather, "--light", "paper", "--longitude", "-90")
    ((world, sensor, _, time, _, _),) = strips
    assert world.light == "paper"
    assert world.shadows == 0
    assert sensor.view.subsatellite_longitude_deg == -90
    assert time == NOON


def test_frames_are_minutes_apart_and_their_winds_longer(weather, strips):
    """Each frame's clouds have been drawn for 20 minutes more."""
    _sensor(weather, "--frames", 3, "--minutes", 20)
    times = [time for _, _, _, time, _, _ in strips]
    assert times == [NOON + timedelta(minutes=20 * i) for i in range(3)]
    drawn = [winds.textures[8000.0, 3.0][0].displacement for *_, winds, _ in strips]
    assert [float(one.duration_s) for one in drawn] == pytest.approx(
        [10800, 12000, 13200]
    )
    way = [np.abs(np.asarray(one.displacement)).max() for one in drawn]
    assert way[1] / way[0] == pytest.approx(200 / 180, rel=0.02)


def test_a_film_is_of_all_frames_and_for_several_only(weather, strips, monkeypatch):
    films = []
    monkeypatch.setattr(
        "cloudjax_scenes.film.write_film",
        lambda file, frames: films.append((file, frames)),
    )
    _sensor(weather, "--frames", 3, "--minutes", 20, "--animation", "gif")
    ((file, frames),) = films
    assert (file.name, len(frames)) == ("out.gif", 3)
    files = "--weather", weather / "gfs.grib2", "-o", weather / "out.nc"
    refused = run("render", *MESO, *files, "--animation", "gif")
    assert "one image is no film" in sentence_of(refused)


def test_a_video_without_ffmpeg_is_refused_before_any_work(
    weather, strips, monkeypatch
):
    monkeypatch.setenv("PATH", "")
    files = "--weather", weather / "gfs.grib2", "-o", weather / "out.nc"
    asked = "--frames", 2, "--animation", "mp4"
    assert "needs ffmpeg" in sentence_of(run("render", *MESO, *files, *asked))
    assert not strips


def test_a_file_that_another_process_renders_stays_alone(weather, strips):
    files = "--weather", weather / "gfs.grib2", "-o", weather / "out.nc"
    with alone(weather, "out.nc"):
        refused = run("render", *MESO, *files)
    assert "is being written by process" in sentence_of(refused)
    assert not strips


@pytest.fixture
def simulated(monkeypatch):
    """The scene that was to be simulated."""
    asked = []

    def simulate_image(scene, made_of):
        asked.append((scene, made_of))
        raise Reached

    monkeypatch.setattr("cloudjax_fit.fitted_image.simulate_image", simulate_image)
    return asked


def _scene(folder, tmp_path, *options):
    result = run("render", folder, "-o", tmp_path / "out.nc", *options)
    assert result.exit_code == 3, result.output
    assert "(Reached)" in result.output


def test_a_scene_is_built_as_the_options_say(scene, tmp_path, simulated):
    given = "--seed", 7, "--steps", 3, "--light", "physical"
    _scene(scene, tmp_path, *given, "--shadows", 5, "--bands", "13")
    ((built, made_of),) = simulated
    assert built.shadows == Shadows(5)
    assert built.bands == (13,)
    assert made_of.seed == 7
    assert {layer.steps for layer in built.layers} == {3}
    assert {layer.cloud.seed % 100 for layer in built.layers} == {7}
    assert len({layer.cloud.seed for layer in built.layers}) == len(built.layers)


def test_a_scene_is_rendered_with_the_fitted_values(scene, tmp_path, simulated):
    """Those of the file where it has some, those of the classes elsewhere."""
    file = tmp_path / "parameters.toml"
    file.write_text(
        'light_strategy = "paper"\n[low_stratus]\nextinction = 0.005\n'
        "[air]\ngain_C13 = 1.05\n"
    )
    _scene(scene, tmp_path, "--light", "paper")
    _scene(scene, tmp_path, "--parameters", file)
    plain, fitted = (asked[0] for asked in simulated)
    low = {layer.name: layer for layer in fitted.layers}["low_stratus"]
    assert float(low.extinction_per_m) == pytest.approx(0.005)
    assert float(fitted.emissive.gain[0]) == pytest.approx(1.05)
    assert float(plain.emissive.gain[0]) == 1.0
    for one, other in zip(plain.layers, fitted.layers, strict=True):
        assert float(one.cloud.function.top_m) == float(other.cloud.function.top_m)


def _spent(scene) -> set[tuple[int, int]]:
    """Steps and nodes of its layers."""
    return {(la.steps, la.cloud.latent.nodes.shape[0]) for la in scene.layers}


def test_a_scene_is_of_the_quality_that_was_asked(scene, simulated, tmp_path):
    _scene(scene, tmp_path, "--light", "physical", "--quality", "draft")
    _scene(scene, tmp_path, "--light", "physical", "--nodes", 2, "--no-scattering")
    (draft, _), (by_hand, _) = simulated
    assert _spent(draft) == {(6, 1)}
    assert draft.emission is not None
    assert _spent(by_hand) == {(24, 2)}
    assert by_hand.emission is None


def test_the_front_that_ships_serves_scenes_from_imagery(
    scene, simulated, tmp_path, monkeypatch
):
    monkeypatch.setattr("platformdirs.user_data_path", lambda _: tmp_path)
    _scene(scene, tmp_path, "--light", "physical", "--max-error", "15%")
    _scene(scene, tmp_path, "--light", "physical", "--max-error", "0.3%")
    ((rough, _), (good, _)) = simulated
    (spent_little,), (spent_much,) = _spent(rough), _spent(good)
    assert math.prod(spent_little) < math.prod(spent_much)
