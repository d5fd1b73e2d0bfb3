"""A fit that was killed goes on where it was, and ends where it would have ended."""

import json
from dataclasses import replace

import numpy as np
import pytest
from tests.small_fits import (
    HELD,
    Killed,
    flecked,
    killed_at,
    small_class,
    small_imagery,
    small_target,
)

from cloudjax_data import DataError
from cloudjax_fit import fit
from cloudjax_fit.checkpoint import Checkpoint
from cloudjax_fit.fit_files import fit_numbers, fit_report
from cloudjax_fit.fit_result import FitResult
from cloudjax_fit.fit_settings import FitSettings
from cloudjax_fit.solver import Solver


SETTINGS = FitSettings(
    rays=576, steps=5, starts=2, max_steps=4, seed=3, statistics="values"
)


@pytest.fixture(scope="module", autouse=True)
def _one_solver():
    """All these fits are solved by what is compiled for the first."""
    made = {}

    class Once(Solver):
        def __init__(self, problem, **course):
            if not made:
                super().__init__(problem, **course)
                made.update(vars(self))
            vars(self).update(made | {f"_{name}": x for name, x in course.items()})

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("cloudjax_fit.solving.Solver", Once)
        yield


@pytest.fixture(scope="module")
def target():
    return small_target(small_imagery(), flecked())


def _fit(target, **course) -> FitResult:
    return fit(
        target,
        settings=SETTINGS,
        classes={"low": small_class()},
        overrides=HELD,
        **course,
    )


@pytest.fixture(scope="module")
def whole(target):
    return _fit(target)


@pytest.mark.parametrize("steps", [2, 5])
def test_a_killed_fit_ends_where_it_would_have_ended(target, whole, tmp_path, steps):
    """Killed in its first start, and in its second: no step is done twice."""
    checkpoint = Checkpoint(tmp_path / "checkpoint", "this")
    with pytest.raises(Killed):
        _fit(target, on_step=killed_at(steps), checkpoint=checkpoint)
    done = []
    again = _fit(
        target, on_step=lambda step, loss: done.append(step), checkpoint=checkpoint
    )
    assert len(done) == 2 * SETTINGS.max_steps - steps
    assert again.history == pytest.approx(whole.history, rel=1e-6)
    for found, expected in zip(again.estimates, whole.estimates, strict=True):
        assert found.value == pytest.approx(expected.value, rel=1e-5)
        assert found.std == pytest.approx(expected.std, rel=1e-4)
    np.testing.assert_allclose(again.image.radiance, whole.image.radiance, rtol=1e-5)


def test_another_fit_and_other_versions_begin_anew(target, tmp_path, monkeypatch):
    checkpoint = Checkpoint(tmp_path / "checkpoint", "this")
    with pytest.raises(Killed):
        _fit(target, on_step=killed_at(2), checkpoint=checkpoint)
    unread = pytest.fail
    assert len(_lines(checkpoint)["starts"]) == 1
    assert replace(checkpoint, asked="that").read(unread) == []
    monkeypatch.setattr("cloudjax_fit.checkpoint.versions", lambda: {"jax": "0"})
    assert checkpoint.read(unread) == []


def _lines(checkpoint: Checkpoint) -> dict:
    assert checkpoint.path is not None
    return json.loads(checkpoint.path.read_bytes().split(b"\n")[0])


def test_a_damaged_checkpoint_is_named(target, tmp_path):
    checkpoint = Checkpoint(tmp_path / "checkpoint", "this")
    with pytest.raises(Killed):
        _fit(target, on_step=killed_at(1), checkpoint=checkpoint)
    content = (tmp_path / "checkpoint").read_bytes()
    (tmp_path / "checkpoint").write_bytes(content[: len(content) // 2])
    with pytest.raises(DataError, match=r"checkpoint is damaged: remove it"):
        _fit(target, checkpoint=checkpoint)


def test_a_fit_that_is_told_to_stop_has_the_best_so_far(target, whole):
    steps = []
    result = _fit(
        target,
        on_step=lambda step, loss: steps.append(step),
        stop=lambda: len(steps) == 2,
    )
    assert steps == [0, 1]
    assert result.interrupted
    assert not result.converged
    assert result.history[:2] == pytest.approx(whole.history[:2])
    assert result.history[-1] == pytest.approx(min(result.history))
    numbers = fit_numbers(result)
    assert numbers["status"] == "interrupted"
    assert numbers["message"].startswith("start 1 of 2: interrupted after 2 steps")
    assert fit_report(result).interrupted
