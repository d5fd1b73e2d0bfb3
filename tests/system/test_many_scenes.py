"""Many scenes by one command: what is done, what is kept, and what an end leaves."""

import csv
import json
import os
import re
import signal
import subprocess
import sys
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import pytest
import xarray as xr

from cloudjax_fit.fit_inputs import read_inputs
from tests.commands import run, sentence_of
from tests.fit_results import made_up_result
from tests.generated import SCAN_START
from tests.scenes import write_scene


@pytest.fixture
def scenes(tmp_path) -> list[Path]:
    return [
        write_scene(tmp_path / name, (13,), start=SCAN_START + timedelta(minutes=i))
        for i, name in enumerate("ab")
    ]


@pytest.fixture
def fitted(scenes, monkeypatch) -> list[str]:
    """The names of the scenes that were fitted, each at once and without a solver."""
    names = []
    result = made_up_result(read_inputs(scenes[0]))

    def fit(target, *, on_step, **_):
        names.append(target.imagery.name)
        on_step(0, 5.0)
        return replace(result, target=target)

    monkeypatch.setattr("cloudjax_cli.fit_folder.fit", fit)
    return names


def _table(folder: Path) -> dict[str, dict[str, str]]:
    with (folder / "summary.csv").open(encoding="utf-8-sig", newline="") as file:
        return {row["scene"]: row for row in csv.DictReader(file)}


def test_what_is_done_is_not_done_again(scenes, fitted, tmp_path):
    def fits_of(*options) -> list[str]:
        fitted.clear()
        result = run("fit", *scenes, "-o", tmp_path / "out", *options)
        assert result.exit_code == 0, result.output
        return sorted(fitted)

    both = ["a", "b"]
    assert fits_of() == both
    assert fits_of("--resume") == []
    assert {row["state"] for row in _table(tmp_path / "out").values()} == {"converged"}
    assert float(_table(tmp_path / "out")["b"]["seconds"]) == 3.5
    assert fits_of() == both
    assert fits_of("--resume", "--seed", "1") == both
    assert fits_of("--resume") == both
    (tmp_path / "out" / "b" / "simulated.nc").unlink()
    assert fits_of("--resume") == ["b"]
    write_scene(scenes[0], (13,), start=SCAN_START, seed=5)
    assert fits_of("--resume") == ["a"]
    (scenes[1] / "scene.toml").write_text("[rule]\ncold_temperature_k = 265.0")
    assert fits_of("--resume") == ["b"]


def test_a_bad_scene_does_not_stop_the_others(scenes, fitted, tmp_path):
    file = next(scenes[0].iterdir())
    file.write_bytes(file.read_bytes()[:3000])
    (tmp_path / "empty").mkdir()
    out = tmp_path / "out"
    result = run("fit", tmp_path / "empty", *scenes, "-o", out)
    assert result.exit_code == 2
    assert fitted == ["b"]
    states = {name: row["state"] for name, row in _table(out).items()}
    assert states == {"empty": "failed", "a": "failed", "b": "converged"}
    assert file.name in _table(out)["a"]["reason"]
    assert (out / "b" / "fit.json").exists()
    assert not (out / "a").exists()


def test_what_all_scenes_share_is_refused_at_once(scenes, fitted, tmp_path):
    out = "-o", tmp_path / "out"
    assert "rays = 0" in sentence_of(run("fit", *scenes, *out, "--rays", "0"))
    (tmp_path / "c.toml").write_text("x = 3")
    said = sentence_of(run("fit", *scenes, *out, "--classes", tmp_path / "c.toml"))
    assert "c.toml" in said
    said = sentence_of(run("render", *scenes, "-o", tmp_path / "out.nc"))
    assert "several images need a folder" in said
    assert not fitted
    assert not (tmp_path / "out").exists()


def test_ctrl_c_ends_with_the_best_so_far(scenes, monkeypatch, tmp_path):
    result = made_up_result(read_inputs(scenes[0]), converged=False)
    begun = []

    def fit(target, *, on_step, stop, **_):
        begun.append(target.imagery.name)
        on_step(0, 5.0)
        assert not stop()
        os.kill(os.getpid(), signal.SIGINT)
        return replace(result, target=target, interrupted=stop(), status="interrupted")

    monkeypatch.setattr("cloudjax_cli.fit_folder.fit", fit)
    out = tmp_path / "out"
    ended = run("fit", *scenes, "-o", out)
    assert ended.exit_code == 130, ended.output
    assert begun == ["a"]
    states = {name: row["state"] for name, row in _table(out).items()}
    assert states == {"a": "interrupted", "b": "not done"}
    assert json.loads((out / "a" / "fit.json").read_text())["status"] == "interrupted"
    assert "✗ Interrupted." in (out / "a" / "report.html").read_text()
    first = (out / "a" / "parameters.toml").read_text().splitlines()[0]
    assert first.endswith("UTC: interrupted")
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    # It is not done yet.
    run("fit", *scenes, "-o", out, "--resume")
    assert begun == ["a", "a"]


def test_several_images_go_into_a_folder(scenes, monkeypatch, tmp_path):
    rendered = []

    def fitted_image(inputs, quality):
        rendered.append(inputs.target.imagery.name)
        return made_up_result(inputs).image, {}

    monkeypatch.setattr("cloudjax_fit.fitted_image.fitted_image", fitted_image)
    out = tmp_path / "out"
    for options in ((), ("--resume",)):
        result = run("render", *scenes, "-o", out, *options)
        assert result.exit_code == 0, result.output
    assert rendered == ["a", "b"]
    names = {p.name for p in out.iterdir()}
    assert names == {
        *("a.nc", "a.png", "b.nc", "b.png"),
        *("summary.csv", "summary.html", "summary.nc"),
    }
    assert _table(out)["a"]["state"] == "rendered"
    with xr.open_dataset(out / "a.nc") as image:
        share = image["cloud_weight"].where(image["radiance_C13"].notnull()).mean()
    assert float(_table(out)["a"]["cloud_fraction_simulated"]) == float(share)
    (out / "a.png").unlink()
    run("render", *scenes, "-o", out, "--resume")
    run("render", *scenes, "-o", out, "--resume", "--shadows", "2")
    assert rendered == ["a", "b", "a", "a", "b"]


SMALL = ("--rays", "512", "--steps", "4", "--light", "paper", "--max-steps", "6")


@pytest.mark.slow
def test_a_fit_killed_outright_goes_on(scenes, tmp_path):
    """By kill -9, as another process: its lock is nobody's then."""
    options = [str(scenes[0]), "-o", str(tmp_path / "out"), *SMALL]
    command = [sys.executable, "-c", "from cloudjax_cli import main; main()", "fit"]
    with subprocess.Popen(
        [*command, *options],
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONUNBUFFERED": "1"},
    ) as killed:
        assert killed.stdout is not None
        for line in killed.stdout:
            if "step 2," in line:
                break
        killed.kill()
    went_on = run("fit", *options, "--resume")
    # The step that was told may be the one that was not kept yet.
    assert re.findall(r"step (\d)", went_on.output)[0] in "23"
    whole = run("fit", str(scenes[0]), "-o", str(tmp_path / "whole"), *SMALL)
    assert went_on.exit_code == whole.exit_code
    found, expected = (
        json.loads((tmp_path / name / "fit.json").read_text())
        for name in ("out", "whole")
    )
    assert found["history"] == pytest.approx(expected["history"], rel=1e-6)
    assert {p.name for p in (tmp_path / "out").iterdir()} == {
        p.name for p in (tmp_path / "whole").iterdir()
    }


@pytest.mark.slow
def test_scenes_are_fitted_on_workers(scenes, tmp_path):
    (tmp_path / "empty").mkdir()
    given = *scenes, tmp_path / "empty", "-o", tmp_path / "out"
    result = run("fit", *given, *SMALL, "--dask", "local:2")
    assert result.exit_code == 2, result.output
    states = {n: row["state"] for n, row in _table(tmp_path / "out").items()}
    assert states["empty"] == "failed"
    assert {states["a"], states["b"]} <= {"converged", "not converged"}
    for name in "ab":
        assert (tmp_path / "out" / name / "report.html").exists()
