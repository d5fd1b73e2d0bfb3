"""What rays and steps of fits are measured to be worth, and the choice of them."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.fit_trades import FITS, KIND, OUTLINE, made_up_fit, made_up_front
from tests.small_fits import HELD, flecked, small_class, small_imagery, small_target

from cloudjax_data import DataError
from cloudjax_fit.fit_settings import FitSettings
from cloudjax_fit.trade import fronts, sweep
from cloudjax_fit.trade.fronts import FitFront, front_for, keep
from cloudjax_fit.trade.outline import FitKind
from cloudjax_fit.trade.quality import CHOICES, DRAFT, REFERENCE, STANDARD, FitQuality
from cloudjax_fit.trade.sweep import FitSweep
from cloudjax_fit.trade.trial import Estimated, FitSubject, fitted
from cloudjax_scenes.trade import fronts as render_fronts
from cloudjax_scenes.trade.machine import Machine


@pytest.fixture(autouse=True)
def _own_folder(tmp_path, monkeypatch):
    """Fronts are kept in a folder of the test."""
    monkeypatch.setattr(
        render_fronts.platformdirs, "user_data_path", lambda _: tmp_path
    )


# Shifts ------------------------------------------------------------------------------


def _estimates(*values: float, std: float = 0.5) -> dict[str, Estimated]:
    linear, unknown, log = values
    return {
        "linear": Estimated(linear, std, log=False, determined=True),
        "unknown": Estimated(unknown, std, log=False, determined=False),
        "log": Estimated(log, std, log=True, determined=True),
    }


def test_shifts_are_in_deviations_of_what_the_reference_determines():
    """Of a logarithmic one the relative change, in its relative deviation."""
    truth = made_up_fit(REFERENCE, estimates=_estimates(2.0, 1.0, 2.0))
    other = made_up_fit(DRAFT, estimates=_estimates(3.0, 9.0, 4.0, std=7.0))
    trial = other.against(truth)
    expected = {"linear": 2.0, "log": np.log(2) * 2.0 / 0.5}
    assert trial.shifts == pytest.approx(expected)
    assert trial.error == pytest.approx(np.sqrt((2.0**2 + expected["log"] ** 2) / 2))
    assert truth.against(truth).error == 0


@pytest.mark.parametrize(
    "known",
    [
        Estimated(2.0, 0.5, log=False, determined=False),
        Estimated(2.0, 0.0, log=False, determined=True),
        Estimated(np.nan, 0.5, log=False, determined=True),
    ],
)
def test_a_reference_that_knows_nothing_is_refused(known):
    truth = made_up_fit(REFERENCE, estimates={"low.top": known})
    with pytest.raises(DataError, match="determine no parameter"):
        truth.against(truth)


def test_a_fit_that_broke_down_is_unsound():
    truth = made_up_fit(REFERENCE)
    assert not made_up_fit(DRAFT, np.nan).against(truth).sound
    assert made_up_fit(DRAFT, 99.0).against(truth).sound


# Sweeps ------------------------------------------------------------------------------


class _Bench:
    """Fits that take as long to solve as their work, by a clock of their own."""

    def __init__(self, monkeypatch, *, compiled_s: float, solve_s: float):
        self.now, self.asked = 0.0, []
        self._compiled_s, self._solve_s = compiled_s, solve_s
        monkeypatch.setattr(
            sweep, "time", SimpleNamespace(perf_counter=lambda: self.now)
        )

    def __call__(self, quality: FitQuality):
        solve_s = self._solve_s * quality.work / REFERENCE.work
        self.asked.append(quality)
        self.now += self._compiled_s + solve_s
        return made_up_fit(quality, solve_s=solve_s, compiled_s=self._compiled_s)


def test_all_choices_are_fitted_the_dearest_first(monkeypatch):
    bench = _Bench(monkeypatch, compiled_s=1.0, solve_s=10.0)
    trials = list(FitSweep(1e6).trials(bench))
    assert bench.asked == [REFERENCE, STANDARD, DRAFT, *CHOICES[2:]]
    assert [trial.quality for trial in trials] == bench.asked
    assert len(set(bench.asked)) == len(bench.asked) >= 8
    assert trials[0].error == 0


def test_no_fit_begins_that_would_end_beyond_the_budget(monkeypatch):
    """What is shorter, and comes later, still begins."""
    bench = _Bench(monkeypatch, compiled_s=10.0, solve_s=80.0)
    long, short = FitQuality(16384, 24), FitQuality(1024, 12)
    # 90 s of the reference, 30 s of the standard, 50 s of the long one.
    budget = 90.0 + 30.0 + 49.0
    list(FitSweep(budget, choices=(STANDARD, long, short)).trials(bench))
    assert bench.asked == [REFERENCE, STANDARD, short]
    assert bench.now < budget


def test_compiling_counts_against_the_budget(monkeypatch):
    bench = _Bench(monkeypatch, compiled_s=100.0, solve_s=8.0)
    list(FitSweep(300.0, choices=(STANDARD, DRAFT)).trials(bench))
    assert bench.asked == [REFERENCE, STANDARD]


def test_the_reference_and_the_first_choice_are_fitted_whatever_the_budget(monkeypatch):
    bench = _Bench(monkeypatch, compiled_s=10.0, solve_s=80.0)
    list(FitSweep(1e-3).trials(bench))
    assert bench.asked == [REFERENCE, STANDARD]


# Fronts ------------------------------------------------------------------------------


def test_what_nothing_beats_is_expected_the_quickest_first():
    expected = made_up_front().expected(OUTLINE)
    assert [one.quality.rays for one in expected] == [1024, 2048, 4096, 8192]
    assert [one.seconds for one in expected] == pytest.approx([11, 13, 16, 30])
    assert [one.error for one in expected] == pytest.approx([3, 2, 0.5, 0.25])


@pytest.mark.parametrize(
    ("error", "rays"), [(10.0, 1024), (2.5, 2048), (0.5, 4096), (0.3, 8192)]
)
def test_an_error_is_met_by_the_quickest_that_does(error, rays):
    found = made_up_front().within_error(error, OUTLINE)
    assert found.quality.rays == rays
    assert found.error <= error


@pytest.mark.parametrize(("seconds", "rays"), [(11.5, 1024), (29.0, 4096), (1e3, 8192)])
def test_a_time_is_met_by_the_best_that_does(seconds, rays):
    found = made_up_front().within_seconds(seconds, OUTLINE)
    assert found.quality.rays == rays
    assert found.seconds <= seconds


def test_what_no_fit_can_do_is_told():
    with pytest.raises(DataError, match="25%"):
        made_up_front().within_error(0.2, OUTLINE)
    with pytest.raises(DataError, match="takes 11 s"):
        made_up_front().within_seconds(10.0, OUTLINE)


@pytest.mark.parametrize(
    ("changes", "seconds"),
    [
        ({"bands": (1, 13)}, 2 * (6 + 10)),
        ({"starts": 3}, 3 * 6 + 10),
        ({"pixels": 4000}, 6 + 4 * 10),
    ],
)
def test_times_grow_with_bands_starts_and_pixels(changes, seconds):
    found = made_up_front().within_error(0.5, replace(OUTLINE, **changes))
    assert found.seconds == pytest.approx(seconds)


def test_times_of_a_slower_machine_are_told_on_this_one():
    slower = made_up_front(work_s=4 * Machine.here().work_s)
    assert slower.within_error(0.5, OUTLINE).seconds == pytest.approx(16.0 / 4)


def test_a_front_is_read_as_it_was_written():
    front = made_up_front()
    assert FitFront.of_json(json.loads(json.dumps(front.json()))) == front


def test_the_machine_s_own_front_goes_before_the_one_that_ships(monkeypatch):
    shipped = made_up_front(work_s=1.0)
    others = made_up_front(FitKind("paper", "texture"))
    monkeypatch.setattr(fronts, "_shipped", lambda: (others, shipped))
    assert front_for(KIND) == (shipped, "shipped, 2 cores")
    file = keep(made_up_front(fits=FITS[:3]))
    assert file is not None
    own, source = front_for(KIND)
    assert (len(own.scene.trials), source) == (3, str(file))
    assert front_for(FitKind("paper", "texture"))[0] is others


def test_a_kind_that_nobody_measured_is_told():
    with pytest.raises(DataError, match="cloudjax tradeoff FOLDER --fit, or give --qu"):
        front_for(FitKind("no", "texture"))


def test_what_ships_can_be_read():
    assert all(front.scene.best for front in fronts._shipped())


def test_little_to_choose_from_is_not_kept():
    assert keep(made_up_front(fits=FITS[:2])) is None
    assert keep(made_up_front()) is not None
    assert keep(made_up_front(fits=FITS[:4])) is None
    assert len(front_for(KIND)[0].scene.trials) == len(FITS)


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"kind": 3}'])
def test_a_file_that_is_no_front_is_told(content):
    file = keep(made_up_front())
    assert file is not None
    file.write_text(content)
    with pytest.raises(DataError, match="remove it, or measure it anew"):
        front_for(KIND)


# One fit -----------------------------------------------------------------------------


def test_a_fit_is_timed_apart_from_its_compiling():
    target = small_target(small_imagery(), flecked())
    settings = FitSettings(seed=3, statistics="values", max_steps=1, rays=1, steps=1)
    subject = FitSubject(
        "small", target, settings, overrides=HELD, classes={"low": small_class()}
    )
    steps = []
    found = fitted(subject, FitQuality(576, 5), lambda step, loss: steps.append(step))
    assert steps == [0]
    assert found.solver_steps == 1
    assert found.state == "not converged"
    assert 0 < found.solve_s <= found.seconds
    assert found.compiled_s > 0
    assert set(found.w1_over_std) == {1, 13}
    assert not set(found.estimates) & set(HELD)
    assert subject.outline.pixels == 24 * 24
    assert subject.outline.bands == (1, 13)
    if any(one.tells for one in found.estimates.values()):
        assert found.against(found).error == 0
