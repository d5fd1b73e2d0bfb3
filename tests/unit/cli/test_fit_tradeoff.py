"""`cloudjax tradeoff --fit`, and `cloudjax fit` by what it measures, without a fit."""

import json
import re
from dataclasses import replace

import click
import numpy as np
import pytest

from cloudjax_cli import fit_tradeoff
from cloudjax_cli.fit_quality import AskedFit
from cloudjax_cli.quality_options import Share
from cloudjax_data.output_lock import alone
from cloudjax_fit import read_inputs
from cloudjax_fit.trade.fronts import keep
from cloudjax_fit.trade.outline import FitKind
from cloudjax_fit.trade.quality import CHOICES, DRAFT, REFERENCE, STANDARD
from cloudjax_scenes.trade import fronts as render_fronts
from tests.commands import run, sentence_of
from tests.fit_results import made_up_result
from tests.fit_trades import made_up_fit, made_up_front
from tests.scenes import NIGHT, write_scene


@pytest.fixture
def scene(tmp_path, monkeypatch):
    """By night; fronts are kept in a folder of the test."""
    monkeypatch.setattr(
        render_fronts.platformdirs, "user_data_path", lambda _: tmp_path
    )
    return write_scene(tmp_path / "scene", bands=(13,), start=NIGHT)


@pytest.fixture
def trials(monkeypatch):
    """The rays and steps that would have been fitted, and what happens at some."""
    return _Trials(monkeypatch)


class _Trials(list):
    def __init__(self, monkeypatch):
        super().__init__()
        self.subjects, self.then = [], {}
        monkeypatch.setattr(fit_tradeoff, "fitted", self._fitted)

    def _fitted(self, subject, quality, on_step):
        on_step(0, 5.0)
        self.subjects.append(subject)
        self.append(quality)
        value = self.then.get(len(self), 2.0 + 1000 / quality.work)
        if value is KeyboardInterrupt:
            raise value
        return made_up_fit(quality, value, solve_s=quality.work / 1000)


@pytest.fixture
def fits(scene, monkeypatch):
    """The settings of the fits that would have been made."""
    asked, result = [], made_up_result(read_inputs(scene))

    def fit(target, *, settings, on_step, **_):
        asked.append(settings)
        on_step(0, 5.0)
        return replace(result, target=target)

    monkeypatch.setattr("cloudjax_cli.fit_folder.fit", fit)
    return asked


def _written(folder):
    return json.loads((folder / "tradeoff.json").read_text())


# Measured ----------------------------------------------------------------------------


def test_a_trade_of_fits_is_measured_written_and_kept(scene, trials, fits, tmp_path):
    out = tmp_path / "out"
    result = run("tradeoff", scene, "--fit", "--light", "paper", "-o", out)
    assert result.exit_code == 0, result.output
    assert trials == [REFERENCE, *CHOICES]
    # Minutes for each, where nobody says.
    left = [int(s) for s in re.findall(r"; (\d+) s left", result.output)]
    assert 1000 < left[-1] <= left[0] <= 1800
    assert trials.subjects[0].settings.light == "paper"
    written = _written(out)
    assert written["kind"] == {"light": "paper", "statistics": "texture"}
    assert len(written["scene"]["trials"]) == len(CHOICES)
    draft = written["scene"]["trials"][CHOICES.index(DRAFT)]
    assert draft["error"] == pytest.approx(2000 * (1 / DRAFT.work - 1 / REFERENCE.work))
    page = (out / "tradeoff.html").read_text()
    assert f"cloudjax fit {scene} --light paper" in page
    assert STANDARD.words in page
    # What is kept chooses for the scene, and the program says how it came out.
    kept = result.output.partition("Kept as ")[2].strip()
    wanted = "--max-error", draft["error"] + 1e-6
    again = run("fit", scene, "--light", "paper", *wanted, "-o", tmp_path / "fit")
    assert again.exit_code == 0, again.output
    assert f"(front: {kept})" in again.output
    assert "s were expected" in again.output
    (settings,) = fits
    assert (settings.rays, settings.steps) == (DRAFT.rays, DRAFT.steps)


def test_a_short_trade_is_written_and_not_kept(scene, trials, tmp_path):
    result = run("tradeoff", scene, "--fit", "--budget", "0.001s", "-o", tmp_path / "o")
    assert result.exit_code == 0, result.output
    assert "Not kept" in result.output
    assert trials == [REFERENCE, STANDARD]
    assert (tmp_path / "o" / "tradeoff.html").exists()


def test_what_was_fitted_before_an_interruption_is_written(scene, trials, tmp_path):
    trials.then[4] = KeyboardInterrupt
    result = run("tradeoff", scene, "--fit", "-o", tmp_path / "out")
    assert result.exit_code == 0, result.output
    assert "Interrupted after 3 fits" in result.output
    rays = [t["quality"]["rays"] for t in _written(tmp_path / "out")["scene"]["trials"]]
    assert rays == [8192, 2048]


def test_no_fit_is_a_sentence(scene, trials, tmp_path):
    trials.then[2] = KeyboardInterrupt
    result = run("tradeoff", scene, "--fit", "-o", tmp_path / "out")
    assert "No fits of" in sentence_of(result)
    assert not (tmp_path / "out" / "tradeoff.json").exists()


def test_a_fit_that_broke_down_is_left_out(scene, trials, tmp_path):
    trials.then[3] = np.nan
    result = run("tradeoff", scene, "--fit", "-o", tmp_path / "out")
    assert result.exit_code == 0, result.output
    assert f"{CHOICES[1].words}: found no numbers" in result.output
    assert len(_written(tmp_path / "out")["scene"]["trials"]) == len(CHOICES) - 1


def test_what_is_compared_is_chosen(scene, trials, tmp_path):
    values = "--statistics", "values", "--budget", "1s"
    result = run("tradeoff", scene, "--fit", *values, "-o", tmp_path / "out")
    assert result.exit_code == 0, result.output
    assert trials.subjects[0].settings.statistics == "values"
    assert _written(tmp_path / "out")["command"].endswith("--statistics values")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--fit", "--shadows", 3), "--shadows is of renders"),
        (("--fit", "--weather", "gfs.grib2"), "--weather is of renders"),
        (("--fit", "--parameters", "p.toml"), "--parameters is of renders"),
        (("--statistics", "values"), "add --fit"),
    ],
)
def test_options_of_others_are_refused(scene, trials, tmp_path, options, said):
    result = run("tradeoff", scene, *options, "-o", tmp_path / "out")
    assert said in sentence_of(result)
    assert trials == []


def test_a_sensor_has_no_fits(scene, trials, tmp_path):
    result = run("tradeoff", "abi-conus-4km", "--fit", "-o", tmp_path / "out")
    assert "no folder of a scene" in sentence_of(result)
    assert trials == []


def test_what_another_process_measures_into_a_folder_stays_alone(
    scene, trials, tmp_path
):
    with alone(tmp_path / "out", "tradeoff"):
        said = sentence_of(run("tradeoff", scene, "--fit", "-o", tmp_path / "out"))
    assert "out is being written by process" in said
    assert trials == []


# Chosen ------------------------------------------------------------------------------


@pytest.fixture
def known(scene):
    """A front of fits in the paper's light that is kept, of one band."""
    file = keep(made_up_front(FitKind("paper", "texture")))
    assert file is not None
    return file


def _fit(*scenes_and_options):
    return run("fit", *scenes_and_options, "--light", "paper")


@pytest.mark.parametrize(
    ("option", "rays", "said"),
    [
        ("--max-error=60%", 4096, "off by 50% of a standard deviation"),
        ("--max-error=250%", 2048, "off by 200% of a standard deviation"),
        ("--max-seconds=1e6", 8192, "off by 25% of a standard deviation"),
    ],
)
def test_a_front_chooses_rays_and_steps(
    scene, fits, known, tmp_path, option, rays, said
):
    result = _fit(scene, option, "-o", tmp_path / "out")
    assert result.exit_code == 0, result.output
    (settings,) = fits
    assert settings.rays == rays
    assert said in result.output
    assert str(known) in result.output
    assert "fitted in" in result.output
    assert "fitted in 0 s" not in result.output


def test_each_of_many_scenes_is_chosen_for(scene, fits, known, tmp_path):
    other = write_scene(tmp_path / "other", bands=(13,), start=NIGHT)
    out = tmp_path / "out"
    result = _fit(scene, other, "--max-error", "60%", "-o", out)
    assert result.exit_code == 0, result.output
    assert [settings.rays for settings in fits] == [4096, 4096]
    # What is done is not done again, unless others are chosen.
    assert _fit(scene, other, "--max-error=60%", "-o", out, "--resume").exit_code == 0
    assert len(fits) == 2
    assert _fit(scene, other, "--max-error=30%", "-o", out, "--resume").exit_code == 0
    assert [settings.rays for settings in fits[2:]] == [8192, 8192]


def test_a_fit_by_hand_tells_no_expectation(scene, fits, tmp_path):
    result = _fit(scene, "--quality", "draft", "-o", tmp_path / "out")
    assert result.exit_code == 0, result.output
    assert "expected" not in result.output
    assert fits[0].rays == 2048


@pytest.mark.parametrize("folders", [1, 2])
def test_without_a_front_nothing_is_fitted(scene, fits, tmp_path, folders):
    """Of one scene it is the sentence of the program, of several that of each."""
    scenes = [scene, write_scene(tmp_path / "other", bands=(13,), start=NIGHT)]
    result = _fit(*scenes[:folders], "--max-error", "50%", "-o", tmp_path / "out")
    assert result.exit_code == 2
    assert result.stderr.count("cloudjax tradeoff FOLDER --fit") == folders
    assert fits == []


def test_what_the_front_cannot_do_is_a_sentence(scene, fits, known, tmp_path):
    assert "25%" in sentence_of(_fit(scene, "--max-error=1%", "-o", tmp_path / "out"))
    assert fits == []


@pytest.mark.parametrize(
    "both",
    [
        ("--max-error=50%", "--max-seconds=3"),
        ("--max-error=50%", "--quality=draft"),
        ("--max-error=50%", "--rays=300"),
        ("--max-seconds=3", "--steps=3"),
    ],
)
def test_two_ways_to_choose_are_refused(scene, fits, known, tmp_path, both):
    result = _fit(scene, *both, "-o", tmp_path / "out")
    assert "both choose: give one" in sentence_of(result)
    assert fits == []


def test_joint_fits_have_no_front(scene, fits, known, tmp_path):
    other = write_scene(tmp_path / "other", bands=(13,), start=NIGHT)
    wanted = "--max-error", "50%", "-o", tmp_path / "out"
    assert "no front is of joint fits" in sentence_of(
        _fit(scene, other, "--joint", *wanted)
    )


def test_shifts_may_be_of_more_than_one_deviation():
    shifts = Share(below=10.0)
    assert shifts.convert("150%", None, None) == pytest.approx(1.5)
    for wrong in ("50", "1000%", "0", "nan"):
        with pytest.raises(click.BadParameter):
            shifts.convert(wrong, None, None)


def test_nothing_asked_asks_no_front():
    options = {"max_error": None, "max_seconds": None, "quality": "draft"}
    asked = AskedFit.of(options | {"rays": None, "steps": None})
    assert not asked.by_front
