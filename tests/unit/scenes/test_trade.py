"""What is measured of a trade, in which order, and what is chosen from it."""

import json
from dataclasses import replace

import numpy as np
import pytest

from cloudjax_data import DataError
from cloudjax_scenes.quality import REFERENCE, STANDARD, Quality
from cloudjax_scenes.trade import fronts
from cloudjax_scenes.trade.fronts import Front, Machine, front_for, keep, read_front
from cloudjax_scenes.trade.page import trade_page
from cloudjax_scenes.trade.sweep import Sweep
from cloudjax_scenes.trade.trial import BandError, Rendered, Trial, band_error


MENU = {"steps": (3, 6, 12, 24, 48), "nodes": (1, 3, 5), "scattering": (False, True)}
TRUE = np.random.default_rng(0).normal(size=4000)


def _cost(quality: Quality) -> float:
    return 0.2 * quality.steps + 0.5 * quality.nodes + 3 * quality.scattering


def _rendered(quality: Quality) -> Rendered:
    """Steps err by 1/steps, nodes by 0.1/nodes, no scattering by 0.02."""
    off = np.random.default_rng(1).normal(size=(3, TRUE.size))
    parts = 1 / quality.steps, 0.1 / quality.nodes, 0.02 * (not quality.scattering)
    off = sum(part * one for part, one in zip(parts, off, strict=True))
    off = off * (quality.steps < REFERENCE.steps)
    return Rendered(quality, {13: TRUE + off}, _cost(quality), 0.0)


@pytest.fixture(scope="module")
def trials():
    return list(Sweep(60.0, MENU).trials(_rendered))


def test_each_knob_is_turned_by_itself_before_any_two(trials):
    reference, standard, *others = (trial.quality for trial in trials)
    assert (reference, standard) == (REFERENCE, STANDARD)
    singles = others[:7]
    assert {one.steps for one in singles} == {3, 6, 12, 24, 48}
    assert {one.nodes for one in singles} == {1, 3, 5}
    assert {one.scattering for one in singles} == {False, True}
    # The cheapest of every knob first.
    assert {(one.steps, one.nodes, one.scattering) for one in others[:3]} == {
        (3, 5, True),
        (24, 1, True),
        (24, 5, False),
    }


def test_what_is_measured_of_many_combinations_reaches_the_front_of_all(trials):
    """A tenth more time than the best of all combinations, at any error."""
    every = [
        _rendered(Quality(steps, nodes, scattering=scattering))
        for steps in MENU["steps"]
        for nodes in MENU["nodes"]
        for scattering in MENU["scattering"]
    ]
    truth = _rendered(REFERENCE)
    all_of_them = [one.against(truth) for one in every]
    measured = trials[1:]
    assert len(measured) < len(every)
    for error in (0.4, 0.2, 0.1, 0.06):
        best, found = (
            min(t.seconds for t in some if t.error <= error)
            for some in (all_of_them, measured)
        )
        assert found <= 1.25 * best


def test_a_budget_ends_the_sweep_after_the_standard():
    def slowly(quality: Quality) -> Rendered:
        return replace(_rendered(quality), first_s=100.0)

    short = list(Sweep(10.0, MENU).trials(slowly))
    assert [trial.quality for trial in short] == [REFERENCE, STANDARD]


def test_errors_are_in_deviations_of_the_true_radiances():
    true = np.array([0.0, 2.0, 4.0, 6.0])
    error = band_error(true + 1, true)
    assert error.bias == pytest.approx(1 / true.std())
    assert error.rmse == pytest.approx(1 / true.std())
    assert error.w1 == pytest.approx(1 / true.std())
    # Pixels that have changed places are right in distribution alone.
    moved = band_error(true[::-1], true)
    assert moved.w1 == moved.bias == 0
    assert moved.rmse > 1
    assert band_error(np.zeros(4), np.zeros(4)).rmse == 0


def _front(trials, **changes) -> Front:
    reference, *others = trials
    own = {
        "kind": "weather in physical light, thermal",
        "subjects": ("abi-meso-2km over gfs.grib2",),
        "pixels": 1000,
        "sample": 100,
        "machine": Machine("2 cores", Machine.here().work_s),
        "reference": reference,
        "trials": tuple(others),
    }
    return Front(**own | changes)


def test_the_quickest_is_chosen_for_an_error_and_the_best_for_a_time(trials):
    front = _front(trials)
    good = front.within_error(0.1)
    assert good.error <= 0.1
    cheaper = [t for t in front.trials if t.seconds < good.seconds]
    assert cheaper
    assert min(t.error for t in cheaper) > 0.1
    # Twice the pixels take twice the time.
    quick = front.within_seconds(8.0, 2000)
    assert quick.seconds <= 4
    better = [t for t in front.trials if t.error < quick.error]
    assert better
    assert min(t.seconds for t in better) > 4


def test_what_no_quality_can_do_is_told(trials):
    front = _front(trials)
    with pytest.raises(DataError, match=r"errs by less than"):
        front.within_error(1e-6)
    with pytest.raises(DataError, match=r"cheapest quality takes"):
        front.within_seconds(1e-6, 1000)


def test_times_are_told_for_this_machine(trials):
    here = Machine.here().work_s
    slow = _front(trials, machine=Machine("another", 2 * here))
    one = slow.trials[0]
    assert slow.expected_s(one, 1000) == pytest.approx(one.seconds / 2)


def test_a_front_is_kept_and_found_again(trials, tmp_path, monkeypatch):
    monkeypatch.setattr(fronts.platformdirs, "user_data_path", lambda _: tmp_path)
    front = _front(trials, kind="nothing that ships")
    with pytest.raises(DataError, match="cloudjax tradeoff"):
        front_for(front.kind)
    file = keep(front)
    found, source = front_for(front.kind)
    assert source == str(file)
    assert found.best == front.best
    file.write_text(file.read_text()[:-100])
    with pytest.raises(DataError, match="measure it"):
        read_front(file)
    file.write_text(json.dumps({"kind": 3}))
    with pytest.raises(DataError, match="measure it"):
        front_for(front.kind)


def test_the_page_tells_the_front_and_how_to_have_it(trials):
    front = _front(trials)
    page = trade_page(front, "cloudjax render abi-meso-2km --weather gfs.grib2")
    assert "cloudjax render abi-meso-2km --weather gfs.grib2 -o OUT.nc" in page
    for trial in front.best:
        assert f"<code>{trial.quality.words}</code>" in page
    # Nothing is asked of the network.
    assert "http://" not in page.split("base64,")[0]
    assert "https://" not in page.split("base64,")[0]


def test_words_of_a_quality_are_options_of_render():
    quality = Quality(12, 3, shadows=6, scattering=False)
    assert quality.words == "--steps 12 --nodes 3 --shadows 6 --no-scattering"
    assert Trial(quality, 1.0, 2.0, {1: BandError(0.0, 0.1, 0.0)}).error == 0.1
