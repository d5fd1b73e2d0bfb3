"""`cloudjax x3d`: what is refused, and that nothing is left then."""

from datetime import timedelta
from types import SimpleNamespace

import pytest

from cloudjax_scenes.x3d import export, sights
from tests.commands import run, sentence_of
from tests.scenes import NIGHT, write_scene
from tests.weather_scenes import NOON
from tests.x3d_files import SMALL, write_model


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return write_model(tmp_path_factory.mktemp("model"))


def _run(model, folder, *options):
    small = "--size-km", 30, *SMALL
    of = "--wrf", model, "--place", "20,-80"
    return run("x3d", *of, *small, *options, "-o", folder)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--boards", 1), "give --boards 2 or more"),
        (("--boards", 0), "boards = 0"),
        (("--centre", "-40,60"), "no cloud in the box"),
        (("--centre", "nan,60"), "is no place"),
        (("--centre", "here"), "is not a latitude and a longitude"),
        (("--size-km", "nan"), "A box of nan km"),
        (("--size-km", 1e5), "A box of 100000 km"),
        (("--pixels", 3), "pixels = 3"),
        (("--sun", "10,-5"), "lights no cloud"),
        (("--sun", "nan,20"), "is not an azimuth"),
        (("--viewer", "nowhere/x3dom.js"), "is no file"),
        (("--flight", "nowhere.csv"), "is not a file"),
        (("--volume", 4), "volume = 4 is none"),
        (("--weather", "x.grib2"), "give one"),
        (("--parameters", "x.toml"), "leave out --parameters"),
        (("--classes", "x.toml"), "leave out --classes"),
    ],
)
def test_bad_input_ends_in_a_sentence_and_leaves_nothing(
    model, tmp_path, options, said
):
    assert said in sentence_of(_run(model, tmp_path / "sky", *options))
    assert not list(tmp_path.rglob("*"))


def test_a_folder_that_is_a_file_is_refused(model, tmp_path):
    (tmp_path / "sky").write_text("")
    assert "is a file" in sentence_of(_run(model, tmp_path / "sky"))


def test_weather_needs_a_place(tmp_path):
    said = sentence_of(run("x3d", "--weather", "x.grib2", "-o", tmp_path / "sky"))
    assert "--centre" in said
    assert "--weather" in sentence_of(run("x3d", "-o", tmp_path / "sky"))


def test_what_breaks_off_does_not_look_whole(model, tmp_path, monkeypatch):
    def full(sky, *, geographic=False):
        raise OSError(28, "No space left on device")

    folder = tmp_path / "sky"
    folder.mkdir()
    for name in ("manifest.json", "scene.x3d"):
        (folder / name).write_text("of an earlier run")
    made = SimpleNamespace(sky=None, images={"textures/up.png": b""}, manifest={})
    monkeypatch.setattr(export, "make_sky", lambda *_: made)
    monkeypatch.setattr(export, "document", full)
    assert "No space left" in sentence_of(_run(model, folder))
    assert not [p.name for p in folder.iterdir() if p.is_file()]


class Reached(Exception):
    """Raised in place of a march."""


@pytest.fixture
def asked(monkeypatch):
    """What is to be shown, and how."""
    found = {}

    def make_sky(sight, settings, on_tile=None):
        found.update(sight=sight, settings=settings)
        raise Reached

    monkeypatch.setattr(export, "make_sky", make_sky)
    return found


def test_weather_reaches_the_boards(weather_folder, tmp_path, asked, monkeypatch):
    def sight_of_weather(*given):
        asked["given"] = given

    monkeypatch.setattr(sights, "sight_of_weather", sight_of_weather)
    files = [weather_folder / name for name in ("gfs.grib2", "classes.toml")]
    given = "--weather", files[0], "--classes", files[1], "--centre", "20,-80"
    run("x3d", *given, "--seed", 3, "--decision", "table1", "-o", tmp_path / "sky")
    world, box, time, sun = asked["given"]
    assert list(world.classes) == ["low", "high"]
    assert (world.seed, world.sources) == (3, ("gfs.grib2",))
    assert world.decision.name == "table1"
    assert (box.latitude_deg, box.longitude_deg, box.size_m) == (20, -80, 50e3)
    assert (time, sun) == (NOON, None)


def test_each_of_several_times_has_a_folder(weather_folder, tmp_path, monkeypatch):
    written = {}
    up = {"boards": [1], "mean_opacity": {"boards": [0.5], "source": 0.5}}

    def write_sky(folder, sight, settings, **_):
        written[folder.name] = sight.time
        return {"clouds": 1, "sectors": {"up": up}}

    monkeypatch.setattr(export, "write_sky", write_sky)
    monkeypatch.setattr(
        sights,
        "sight_of_weather",
        lambda world, box, time, sun: SimpleNamespace(time=time, notes=()),
    )
    files = [weather_folder / name for name in ("gfs.grib2", "classes.toml")]
    given = "--weather", files[0], "--classes", files[1], "--centre", "20,-80"
    times = NOON, NOON + timedelta(minutes=30)
    asked = [x for time in times for x in ("--time", f"{time:%Y-%m-%dT%H:%M}")]
    done = run("x3d", *given, *asked, "-o", tmp_path / "sky")
    assert done.exit_code == 0, done.output
    assert written == {f"{time:%Y-%m-%dT%H%M}": time for time in times}
    run("x3d", *given, *asked[:2], "-o", tmp_path / "sky")
    assert written.pop("sky") == NOON


def test_a_flight_elsewhere_is_refused_before_any_work(model, tmp_path, asked):
    flight = tmp_path / "f.csv"
    flight.write_text("time,latitude,longitude,height_m\n0,50,20,9\n1,50,21,9\n")
    said = sentence_of(_run(model, tmp_path / "sky", "--flight", flight))
    assert "f.csv stays" in said
    assert not asked


@pytest.mark.slow
def test_a_scene_of_imagery_reaches_the_boards(tmp_path, asked):
    scene = write_scene(tmp_path / "scene")
    # Its extinction is a share of the physical one.
    (scene / "scene.toml").write_text('[fit]\nlight = "paper"\n')
    run("x3d", scene, "--sun", "90,30", "-o", tmp_path / "sky")
    sight = asked["sight"]
    assert sight.scene.reflective.numbers == (1, 3)
    assert sight.extinction_share == pytest.approx(0.075)
    assert sight.sun_deg == pytest.approx((90, 30))


def test_a_scene_of_the_night_is_refused(tmp_path, asked):
    scene = write_scene(tmp_path / "scene", bands=(13, 15), start=NIGHT)
    assert "sees the sun" in sentence_of(run("x3d", scene, "-o", tmp_path / "sky"))
