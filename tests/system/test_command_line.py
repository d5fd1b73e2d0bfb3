"""The command line as its users meet it: files, exit codes, and one sentence."""

import json
import os
import re
import subprocess
import sys
import time
from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest
import tomli_w
import xarray as xr

from cloudjax import class_table, imagery_classes
from cloudjax_cli import main
from cloudjax_fit.fit_inputs import FitInputs, read_inputs
from cloudjax_fit.fit_settings import FitSettings
from tests.commands import run, sentence_of
from tests.fit_results import made_up_result
from tests.generated import SCAN_START
from tests.scenes import NIGHT, write_scene, write_weather


SMALL = ("--rays", "512", "--steps", "8", "--max-steps", "3")
FILES = {"fit.json", "parameters.toml", "report.html", "simulated.nc"}


@pytest.fixture
def scene(tmp_path) -> Path:
    return write_scene(tmp_path / "scene")


class Calls(list):
    """What the fit was called with; `run` is where its made-up result is from."""

    run: FitInputs

    def __init__(self):
        super().__init__()
        self.classes = []


@pytest.fixture
def no_solver(monkeypatch):
    """A result at once, and a record of what was asked."""
    calls = Calls()

    def fit(target, *, settings, overrides, analysis, classes, on_step=None, **_):
        calls.classes.append(classes)
        calls.append((target, settings, overrides, analysis))
        if on_step is not None:
            on_step(1, 5.0)
        return made_up_result(calls.run)

    monkeypatch.setattr("cloudjax_cli.fit_folder.fit", fit)
    return calls


@pytest.mark.slow
def test_compiled_functions_are_kept_where_asked(tmp_path):
    """In a process of its own, for JAX reads the setting when it is imported."""
    cache = tmp_path / "cache"
    code = "from cloudjax_cli import main; main()"
    command = [sys.executable, "-c", code, "--compilation-cache", str(cache), "doctor"]
    subprocess.run(command, check=True, capture_output=True)
    assert list(cache.iterdir())


def test_help_is_quick_and_leaves_jax_alone():
    code = (
        "import sys, cloudjax_cli\n"
        "heavy = {'jax', 'numpy', 'xarray', 'matplotlib'} & set(sys.modules)\n"
        "sys.exit(f'imported {heavy}' if heavy else 0)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
    command = [sys.executable, "-m", "cloudjax_cli", "--help"]
    best = min(_seconds(command) for _ in range(3))
    assert best < 0.5


def _seconds(command: list[str]) -> float:
    started = time.perf_counter()
    subprocess.run(command, check=True, capture_output=True)
    return time.perf_counter() - started


def test_every_command_has_help():
    for name, command in main.commands.items():
        result = run(name, "--help")
        assert result.exit_code == 0
        assert str(command.help).splitlines()[0] in result.output


def test_info_by_day(scene):
    (scene / "notes.txt").write_text("a note")
    write_weather(scene, SCAN_START - timedelta(hours=2))
    result = run("info", scene)
    assert result.exit_code == 0, result.output
    lines = dict(_label_and_text(line) for line in result.output.splitlines())
    assert lines["satellite"] == "G17 (GOES-West), sector M1"
    assert lines["sun"].startswith("day")
    assert "48 x 48 at 2.0 km, 100.00% good" in lines["band 13"]
    assert lines["missing"].startswith("bands 2, 4")
    assert "-2.0 hours from the imagery: near enough" in lines["weather"]
    assert lines["ignored"] == "notes.txt"
    assert lines["sunlight"] == "for bands 1, 3, physical light"
    assert lines["thermal scattering"].startswith("by slabs")
    assert lines["shadows"].startswith("left out")
    assert lines["advection"].endswith("gfs.grib2")
    assert lines["air"].endswith("gfs.grib2")


def test_info_in_the_paper_s_light(scene):
    result = run("info", scene, "--light", "paper")
    assert result.exit_code == 0, result.output
    lines = dict(_label_and_text(line) for line in result.output.splitlines())
    assert lines["sunlight"] == "for bands 1, 3, paper light"
    assert lines["thermal scattering"].startswith("left out")
    assert lines["air"].startswith("left out")


def test_info_tells_the_air_of_each_band(scene):
    write_weather(scene, SCAN_START - timedelta(hours=2))
    result = run("info", scene)
    assert result.exit_code == 0, result.output
    lines = dict(_label_and_text(line) for line in result.output.splitlines())
    assert lines["air"].endswith("the mean profile of gfs.grib2")
    assert "Rayleigh of optical depth 0.184, gases left out" in lines["air of C01"]
    assert "gases of optical depth 0.15" in lines["air of C13"]
    assert lines["thermal scattering"].startswith("by slabs")
    result = run("info", scene, "--light", "dim")
    assert "physical" in result.output


def test_info_by_night(tmp_path):
    result = run("info", write_scene(tmp_path / "night", start=NIGHT))
    lines = dict(_label_and_text(line) for line in result.output.splitlines())
    assert lines["sun"].startswith("night")
    assert lines["bands"] == "13"
    assert lines["emission"] == "for bands 13"
    assert lines["sunlight"].startswith("left out")
    assert lines["advection"].startswith("left out")


def test_info_says_why_there_can_be_no_run(scene):
    write_weather(scene, SCAN_START - timedelta(hours=20))
    result = run("info", scene)
    assert result.exit_code == 0
    assert "too far" in result.output
    assert "no run" in result.output


def _label_and_text(line: str) -> tuple[str, str]:
    return line[:20].strip(), line[20:].strip()


def test_fit_report_and_render(scene, tmp_path):
    """One small fit of everything, and what can be done with its files."""
    out = tmp_path / "out"
    result = run("fit", scene, "--bands", "3,13", "-o", out, *SMALL, "--light", "paper")
    assert result.exit_code == 1, result.output
    assert result.stderr == ""
    assert "scene: step 1, loss" in result.stdout
    assert "NOT converged" in result.stdout
    assert {file.name for file in out.iterdir()} == FILES
    numbers = json.loads((out / "fit.json").read_text())
    assert numbers["status"] == "not converged"
    assert numbers["settings"]["rays"] == 512
    assert set(numbers["bands"]) == {"3", "13"}

    result = run("report", scene, out / "simulated.nc", "-o", tmp_path / "compared")
    assert result.exit_code == 0, result.output
    compared = json.loads((tmp_path / "compared" / "report.json").read_text())
    assert set(compared["bands"]) == {"3", "13"}

    image = tmp_path / "image.nc"
    parameters = out / "parameters.toml"
    options = "--bands", "3,13", "--steps", "8", "--parameters", parameters
    asked = "--quantity", "radiance", "--quantity", "reflectance"
    result = run("render", scene, "-o", image, *options, *asked)
    assert result.exit_code == 0, result.output
    assert image.with_suffix(".png").read_bytes().startswith(b"\x89PNG")
    with xr.open_dataset(image) as again, xr.open_dataset(out / "simulated.nc") as fit:
        np.testing.assert_allclose(again["radiance_C13"], fit["radiance_C13"], 1e-5)
        assert float(again["reflectance_C03"].max()) < 1.5
        assert "brightness_temperature_C13" not in again


def test_settings_of_the_scene_and_of_the_command_line(scene, tmp_path, no_solver):
    (scene / "scene.toml").write_text(
        '[fit]\nbands = [1, 13]\nrays = 99\n[parameters."cirrus.top"]\nfree = false'
    )
    no_solver.run = read_inputs(scene)
    result = run("fit", scene, "-o", tmp_path / "out", "--seed", "3")
    assert result.exit_code == 0, result.output
    ((target, settings, overrides, analysis),) = no_solver
    assert list(target.imagery.bands) == [1, 13]
    assert settings == FitSettings(rays=99, seed=3)
    assert overrides == {"cirrus.top": {"free": False}}
    assert analysis is None
    assert no_solver.classes == [None]


def test_classes_of_the_user_reach_the_fit(scene, tmp_path, no_solver):
    """Low cloud alone: high cloud is then no one's."""
    one = {"mine": class_table(imagery_classes()["low_stratus"])}
    (tmp_path / "mine.toml").write_text(tomli_w.dumps(one))
    classes = "--classes", tmp_path / "mine.toml"
    no_solver.run = read_inputs(scene, classes=tmp_path / "mine.toml")
    result = run("fit", scene, "-o", tmp_path / "out", *classes)
    assert result.exit_code == 0, result.output
    ((target, *_),) = no_solver
    assert list(target.imagery.fractions) == ["mine"]
    assert list(no_solver.classes[0]) == ["mine"]
    (tmp_path / "mine.toml").write_text(tomli_w.dumps(one | {"other": {}}))
    refused = run("fit", scene, "-o", tmp_path / "out", *classes)
    assert refused.exit_code == 2
    assert "mine.toml: class other has no threshold" in refused.stderr


def test_several_scenes_get_a_folder_each(scene, tmp_path, no_solver):
    other = write_scene(tmp_path / "other", start=SCAN_START + timedelta(minutes=5))
    no_solver.run = read_inputs(scene)
    result = run("fit", scene, other, "-o", tmp_path / "out")
    assert result.exit_code == 0, result.output
    for name in ("scene", "other"):
        assert {file.name for file in (tmp_path / "out" / name).iterdir()} == FILES


def test_weather_goes_into_the_fit_unless_it_is_ignored(scene, tmp_path, no_solver):
    write_weather(scene, SCAN_START - timedelta(hours=2))
    no_solver.run = read_inputs(scene)
    for option in ((), ("--ignore-weather",)):
        assert run("fit", scene, "-o", tmp_path / "out", *option).exit_code == 0
    used, ignored = (call[-1] for call in no_solver)
    assert used.cube.path.name == "gfs.grib2"
    assert ignored is None


def test_a_mask_from_the_weather_needs_a_weather_file(scene, tmp_path, no_solver):
    refused = run("fit", scene, "-o", tmp_path / "out", "--weather-mask")
    assert refused.exit_code == 2
    assert "weather file" in refused.stderr
    write_weather(scene, SCAN_START)
    no_solver.run = read_inputs(scene)
    assert run("fit", scene, "-o", tmp_path / "out", "--weather-mask").exit_code == 0
    ((target, *_),) = no_solver
    # One air mass everywhere, and not the imagery's clouds.
    assert all(
        np.ptp(f) < 0.01 and f.max() < 0.5 for f in target.imagery.fractions.values()
    )


def test_the_demonstration_fits_the_embedded_scene(scene, tmp_path, no_solver):
    no_solver.run = read_inputs(scene)
    result = run("demo", "-o", tmp_path / "demo", "--starts", "2")
    assert result.exit_code == 0, result.output
    ((target, settings, _, _),) = no_solver
    assert target.imagery.name == "goes17_m1_20191027T2000"
    assert settings == FitSettings(starts=2, light="paper")


def test_doctor_reports_and_passes():
    result = run("doctor")
    assert result.exit_code == 0, result.output
    for word in ("jaxlib", "device", "x64", "derivatives ok"):
        assert word in result.output


def test_doctor_says_what_to_install(monkeypatch):
    from cloudjax_cli import self_test as doctor

    # As the bad release does: forward mode alone is off.
    monkeypatch.setattr(
        doctor.jax, "jacfwd", lambda f: lambda v: 0.6 + doctor.jax.jacrev(f)(v)
    )
    result = run("doctor")
    assert result.exit_code == 1
    assert 'pip install "jax>=0.9,!=0.10.2"' in result.output


@pytest.mark.parametrize("command", ["fit", "render"])
def test_a_truncated_file_is_named(scene, tmp_path, command):
    file = sorted(scene.glob("*C13*"))[0]
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    sentence = sentence_of(run(command, scene, "-o", tmp_path / "out.nc"))
    assert file.name in sentence


def test_a_missing_band_is_named(scene, tmp_path):
    sentence = sentence_of(run("fit", scene, "--bands", "1,14", "-o", tmp_path / "o"))
    assert "does not hold band 14" in sentence
    assert str(scene) in sentence


def test_reflective_bands_at_night_are_refused(tmp_path):
    scene = write_scene(tmp_path / "night", start=NIGHT)
    sentence = sentence_of(run("fit", scene, "--bands", "1,3", "-o", tmp_path / "o"))
    assert "night is dark" in sentence


@pytest.mark.parametrize("command", ["fit", "render"])
def test_weather_hours_away_is_refused(scene, tmp_path, command):
    write_weather(scene, SCAN_START + timedelta(hours=6))
    sentence = sentence_of(run(command, scene, "-o", tmp_path / "out.nc"))
    assert "gfs.grib2" in sentence
    assert "6.0 hours from the imagery" in sentence


@pytest.mark.parametrize("command", ["fit", "render", "info"])
def test_an_empty_folder_is_refused(tmp_path, command):
    empty = tmp_path / "empty"
    empty.mkdir()
    output = () if command == "info" else ("-o", tmp_path / "out.nc")
    assert str(empty) in sentence_of(run(command, empty, *output))
    missing = "is not a file" if command == "render" else "does not exist"
    assert missing in sentence_of(run(command, tmp_path / "no", *output))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[fit]\nrayes = 3", "'rayes': the nearest known one is 'rays'"),
        ("[fits]\nrays = 3", "the nearest known one is 'fit'"),
        ('[parameters."cirrus.topp"]\nfree = true', "'cirrus.top'"),
        ('[parameters."cirrus.top"]\ndefault = 1.0', "not between its bounds"),
        ("[fit", "not valid TOML"),
    ],
)
def test_a_bad_scene_toml_is_refused(scene, tmp_path, text, words):
    (scene / "scene.toml").write_text(text)
    sentence = sentence_of(run("fit", scene, "-o", tmp_path / "out"))
    assert str(scene / "scene.toml") in sentence
    assert words in sentence


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[cirrus]\ntopp = 9000.0", "'cirrus.topp': the nearest known one"),
        ("[cirrus]\ntop = 90000.0", "keep it between"),
        ("cirrus = 3", "outside of a section"),
    ],
)
def test_bad_parameters_are_refused(scene, tmp_path, text, words):
    file = tmp_path / "parameters.toml"
    file.write_text(text)
    output = "-o", tmp_path / "out.nc"
    sentence = sentence_of(run("render", scene, *output, "--parameters", file))
    assert str(file) in sentence
    assert words in sentence


@pytest.mark.parametrize("command", ["fit", "demo", "render", "report"])
def test_an_output_that_cannot_be_written_is_refused_at_once(scene, tmp_path, command):
    blocked = tmp_path / "blocked"
    blocked.write_text("a file")
    inputs = {"demo": (), "report": (scene, scene)}.get(command, (scene,))
    sentence = sentence_of(run(command, *inputs, "-o", blocked / "out.nc"))
    assert str(blocked) in sentence


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_without_permission_is_refused(scene, tmp_path):
    closed = tmp_path / "closed"
    closed.mkdir(mode=0o500)
    assert "not writable" in sentence_of(run("fit", scene, "-o", closed / "out"))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("fit",), "Missing argument"),
        (("fit", "a", "--bands", "x", "-o", "b"), "list of band numbers"),
        (("fit", "a", "--bands", "17", "-o", "b"), "a band that ABI lacks"),
        (("fit", "a/x", "b/x", "-o", "b"), "the same name"),
        (("render", "a", "-o", "b.png"), "not *.nc"),
        (("fitt",), "No such command"),
        (("report", "a", "b", "-o", "c"), "a does not exist"),
    ],
)
def test_wrong_usage_is_one_sentence_too(arguments, words):
    assert words in sentence_of(run(*arguments))


def test_a_setting_that_is_too_small_is_refused(scene, tmp_path):
    result = run("fit", scene, "-o", tmp_path / "out", "--rays", "0")
    assert "rays = 0" in sentence_of(result)


def test_an_interruption_leaves_nothing(scene, tmp_path, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("cloudjax_cli.fit_folder.fit", interrupted)
    result = run("fit", scene, "-o", tmp_path / "out")
    assert result.exit_code == 130
    assert not (tmp_path / "out").exists()


def test_a_bug_keeps_its_trace(scene, tmp_path, monkeypatch):
    def broken(*_, **__):
        raise ZeroDivisionError

    monkeypatch.setattr("cloudjax_cli.fit_folder.fit", broken)
    result = run("fit", scene, "-o", tmp_path / "out")
    assert result.exit_code == 3
    (trace,) = re.findall(r"report it with (\S+\.txt)", result.output)
    assert "ZeroDivisionError" in Path(trace).read_text()
    debugged = run("--debug", "fit", scene, "-o", tmp_path / "out")
    assert debugged.exit_code == 3
    assert "Traceback" in debugged.output


@pytest.mark.shared_data
def test_the_real_scenes_say_what_they_are(shared_data):
    day = run("info", shared_data / "goes17_m1_20191027T2000")
    assert day.exit_code == 0, day.output
    assert "day: 32 to 47 deg" in day.output
    assert "missing             bands 2\n" in day.output
    night = shared_data / "goes17_m1_20191201T1027_night"
    assert "night, reflective bands see no cloud" in run("info", night).output


@pytest.mark.shared_data
def test_a_visible_fit_of_the_real_night_scene_is_refused(shared_data, tmp_path):
    night = shared_data / "goes17_m1_20191201T1027_night"
    sentence = sentence_of(run("fit", night, "--bands", "1,3,13", "-o", tmp_path / "o"))
    assert "is dark" in sentence


@pytest.mark.shared_data
def test_the_real_weather_of_another_year_is_refused(shared_data, tmp_path):
    for folder in ("goes17_m1_20191027T2000", "gfs_2p5deg_20110115T12"):
        for file in (shared_data / folder).iterdir():
            (tmp_path / file.name).symlink_to(file)
    assert "hours from the imagery" in sentence_of(
        run("fit", tmp_path, "--bands", "1,3,13", "-o", tmp_path / "out")
    )


@pytest.mark.slow
def test_the_demonstration_converges(tmp_path):
    result = run("demo", "-o", tmp_path)
    assert result.exit_code == 0, result.output
    bands = json.loads((tmp_path / "fit.json").read_text())["bands"]
    for band in bands.values():
        assert band["w1_fit_over_std"] < band["w1_start_over_std"] / 3
