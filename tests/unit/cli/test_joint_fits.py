"""`cloudjax fit --joint`: which scenes, which files, and what is refused."""

import csv
import json
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax_fit.joint_fitting import JointFit
from cloudjax_fit.phases import Phases
from cloudjax_fit.sharing import join
from cloudjax_fit.solver import Solution
from cloudjax_fit.uncertainty import Estimate
from cloudjax_scenes.simulated_image import SimulatedImage
from tests.commands import run, sentence_of
from tests.scenes import write_scene
from tests.small_fits import Killed


@pytest.fixture(scope="module")
def scenes(tmp_path_factory) -> list[Path]:
    folder = tmp_path_factory.mktemp("scenes")
    return [write_scene(folder / name, (13,)) for name in "abc"]


@pytest.fixture
def joint(monkeypatch) -> list[list[str]]:
    """The names of scenes that were fitted together, without a solver."""
    calls = []

    def fit(scenes, sharing, *, on_step, checkpoint, **_):
        joined = join(scenes, sharing)
        calls.append([scene.name for scene in scenes])
        on_step(0, 5.0)
        found = [
            Estimate(p, p.default, p.default, 0.1, True, False)
            for p in joined.parameters
        ]
        z, none = np.zeros(len(found)), np.zeros((0, len(found)))
        end = Solution(z, True, "converged in 1 step", none, [], (5.0,), 0.0)
        return JointFit(scenes, joined, end, end.message, found, [], Phases())

    monkeypatch.setattr("cloudjax_cli.joint_scenes.joint_fit", fit)
    monkeypatch.setattr("cloudjax_fit.fittable_scene.simulate_image", _seen)
    monkeypatch.setattr("cloudjax_fit.joint_fitting.simulate_image", _seen)
    return calls


def _seen(scene, made_of):
    """An image that nobody rendered."""
    shape = made_of.imagery.grid.shape
    radiance = jnp.broadcast_to(jnp.linspace(60.0, 100.0, shape[1]), (1, *shape))
    return SimulatedImage(
        scene.bands,
        np.asarray(radiance),
        np.ones(shape),
        np.ones((len(scene.layers), *shape)),
    )


def test_scenes_are_fitted_together_and_others_are_tested(scenes, joint, tmp_path):
    a, b, c = scenes
    out = tmp_path / "out"
    done = run("fit", a, "--joint", "--test", b, c, "-o", out, "--rays", "40")
    assert done.exit_code == 0, done.output
    assert joint == [["a"]]
    with (out / "summary.csv").open(encoding="utf-8-sig", newline="") as file:
        states = {row["scene"]: row["state"] for row in csv.DictReader(file)}
    assert states == {"a": "converged", "b": "tested", "c": "tested"}
    assert (out / "a" / "report.html").is_file()
    assert [p.name for p in (out / "b").iterdir()] == ["simulated.nc"]
    numbers = json.loads((out / "joint.json").read_text())
    assert set(numbers["tests"]) == {"b", "c"}
    assert "thick_cold.threshold" in numbers["shared"]
    assert "thick_cold.top" not in numbers["shared"]
    assert (
        "thick_cold.top" in json.loads((out / "a/fit.json").read_text())["parameters"]
    )
    assert "[thick_cold]" in (out / "parameters.toml").read_text()
    assert "thick_cold.threshold" in (out / "summary.html").read_text()


def test_what_is_whole_is_not_fitted_again(scenes, joint, tmp_path):
    a, b, _ = scenes
    out = tmp_path / "out"
    command = "fit", a, b, "--joint", "-o", out
    run(*command)
    again = run(*command, "--resume")
    assert again.exit_code == 0, again.output
    assert "converged in an earlier run" in again.output
    assert joint == [["a", "b"]]
    (tmp_path / "t.toml").write_text('[shared]\n"*.top" = true\n')
    run(*command, "--resume", "--shared", tmp_path / "t.toml")
    (out / "b" / "fit.json").unlink()
    run(*command, "--resume")
    assert joint == [["a", "b"]] * 3


def test_a_joint_fit_that_was_killed_goes_on_only_if_asked(
    scenes, monkeypatch, tmp_path
):
    """By the checkpoint that an earlier run left in the folder."""
    begun = []

    def killed(scenes, sharing, *, checkpoint, **_):
        begun.append(checkpoint.path.exists())
        checkpoint.path.write_text("how far it has come")
        raise Killed

    monkeypatch.setattr("cloudjax_cli.joint_scenes.joint_fit", killed)
    for options in ((), ("--resume",), ()):
        run("fit", *scenes[:2], "--joint", "-o", tmp_path / "out", *options)
    assert begun == [False, True, False]


def test_what_cannot_be_is_refused(scenes, joint, tmp_path):
    a, b, _ = scenes
    out = "-o", tmp_path / "out"
    said = sentence_of(run("fit", a, "--joint", *out))
    assert "a joint fit needs several scenes" in said
    said = sentence_of(run("fit", a, b, "--joint", "--dask", "local", *out))
    assert "leave out --dask" in said
    assert "--test is of joint fits" in sentence_of(run("fit", a, "--test", b, *out))
    said = sentence_of(run("fit", a, b, "--joint", "--shared", "none.toml", *out))
    assert "none.toml" in said
    (b / "scene.toml").write_text('[parameters."thick_cold.threshold"]\nspread = 3\n')
    try:
        said = sentence_of(run("fit", a, b, "--joint", *out))
    finally:
        (b / "scene.toml").unlink()
    assert "a and b have different values of spread for thick_cold.threshold" in said
    assert not joint
    assert not (tmp_path / "out").exists()
