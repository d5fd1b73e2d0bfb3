"""What is measured of a trade, in which order, and what is chosen from it."""

import json
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cloudjax import Rays
from cloudjax_data import DataError
from cloudjax_scenes.quality import REFERENCE, STANDARD, Quality
from cloudjax_scenes.trade import fronts
from cloudjax_scenes.trade.fronts import Front, front_for, keep, read_front
from cloudjax_scenes.trade.machine import Machine
from cloudjax_scenes.trade.measured import Measured
from cloudjax_scenes.trade.outline import Kind, Outline
from cloudjax_scenes.trade.page import trade_page
from cloudjax_scenes.trade.sweep import Foreseen, Sweep
from cloudjax_scenes.trade.trial import (
    BandError,
    Rendered,
    Subject,
    Trial,
    band_error,
    rendered,
)


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
    return Rendered(quality, {13: TRUE + off}, _cost(quality), 0.0, 0.0)


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
    # Of what is seen the deviation does not matter.
    assert band_error(np.full(4, 3.0), true).rmse == pytest.approx(1)


def test_two_sizes_part_the_pixels_from_the_rest(monkeypatch):
    """A render of 2 s and of 10 ms a pixel, by renders of 1000 pixels and of 250."""
    now = [0.0]

    def render(scene, rays, *_, **__):
        now[0] += 2.0 + 0.01 * len(rays)
        return SimpleNamespace(radiances=np.zeros((1, len(rays))))

    monkeypatch.setattr("time.perf_counter", lambda: now[0])
    monkeypatch.setattr("cloudjax_scenes.trade.trial.render", render)
    scene: Any = SimpleNamespace(bands=(13,), total=lambda seen: seen)
    lines = np.zeros((1000, 3))
    outline = _outline(pixels=1_000_000)
    subject = Subject("", outline, lambda _: scene, Rays(lines, lines, 0.0), lines[0])
    found = rendered(subject, STANDARD)
    assert (found.fixed_s, found.seconds) == pytest.approx((2.0, 10_002.0))
    assert found.first_s == pytest.approx(12.0)


def test_squares_of_errors_add_and_factors_of_time_multiply():
    """Half of the time and a third of it make a sixth; what two knobs add to the square
    of the standard's error is what each adds alone.
    """

    def trial(seconds: float, error: float, **turned) -> Trial:
        errors = {13: BandError(0.0, error, 0.0)}
        return Trial(replace(STANDARD, **turned), seconds, 0.0, 0.0, errors)

    known = [
        trial(6.0, 0.03),
        trial(3.0, 0.05, steps=12),
        trial(2.0, 0.06, nodes=1),
        trial(9.0, 0.02, steps=48),
    ]
    foreseen = Foreseen.of(STANDARD, known)
    assert foreseen(STANDARD) == pytest.approx((6.0, 0.03))
    both = foreseen(replace(STANDARD, steps=12, nodes=1))
    assert both == pytest.approx((1.0, np.sqrt(0.0025 + 0.0036 - 0.0009)))
    better = foreseen(replace(STANDARD, steps=48, nodes=1))
    assert better == pytest.approx((3.0, np.sqrt(0.0004 + 0.0036 - 0.0009)))


KIND = Kind("weather", "physical", sunlit=False, thermal=True, shaded=False)


def _outline(pixels: int = 1000, pixel_m: float = 2000.0, bands=(13,)) -> Outline:
    return Outline(KIND, bands, pixel_m, pixels)


def _measured(trials, outline: Outline) -> Measured:
    reference, *others = trials
    return Measured("abi-meso-2km over gfs.grib2", outline, 100, reference, others)


def _front(trials, **changes) -> Front:
    own = {
        "kind": KIND,
        "machine": Machine("2 cores", Machine.here().work_s),
        "scenes": (_measured(trials, _outline()),),
    }
    return Front(**own | changes)


def test_the_quickest_is_chosen_for_an_error_and_the_best_for_a_time(trials):
    front = _front(trials)
    good = front.within_error(0.1, _outline())
    assert good.error <= 0.1
    cheaper = [t for t in trials[1:] if t.seconds < good.seconds]
    assert cheaper
    assert min(t.error for t in cheaper) > 0.1
    # Twice the pixels take twice the time.
    quick = front.within_seconds(8.0, _outline(2000))
    assert 4 < quick.seconds <= 8
    better = [t for t in trials[1:] if t.error < 0.999 * quick.error]
    assert better
    assert min(t.seconds for t in better) > 4


def test_what_no_quality_can_do_is_told(trials):
    front = _front(trials)
    with pytest.raises(DataError, match=r"errs by less than"):
        front.within_error(1e-6, _outline())
    with pytest.raises(DataError, match=r"cheapest quality takes"):
        front.within_seconds(1e-6, _outline())


def _of_standard(front: Front, outline: Outline):
    """What is expected of the only quality of a front."""
    (found,) = front.expected(outline)
    return found


def test_times_are_told_for_this_machine(trials):
    few = trials[:2]
    here = Machine.here().work_s
    slow = _front(few, machine=Machine("another", 2 * here))
    found = _of_standard(slow, _outline())
    assert found.seconds == pytest.approx(few[1].seconds / 2)


def test_what_a_render_takes_whatever_its_size_is_taken_once(trials):
    reference, one = trials[:2]
    one = replace(one, seconds=5.0, fixed_s=2.0)
    front = _front((reference, one))
    assert _of_standard(front, _outline(2000)).seconds == pytest.approx(8.0)


def test_only_bands_that_are_asked_err(trials):
    reference, one = trials[:2]
    errors = {
        2: BandError(0.0, 0.3, 0.0),
        7: BandError(0.0, 0.2, 0.0),
        13: BandError(0.0, 0.1, 0.0),
    }
    reference, one = (replace(t, errors=errors) for t in (reference, one))
    outline = _outline(bands=(2, 7, 13))
    front = _front((reference, one), scenes=(_measured((reference, one), outline),))
    # Bands 1 and 15 are nearest to bands 2 and 13 of those that were measured.
    for bands, error in {(13,): 0.1, (15,): 0.1, (1, 13): 0.3, (13, 7): 0.2}.items():
        found = _of_standard(front, _outline(bands=bands))
        assert found.error == pytest.approx(error)
    # Fewer bands take less time, but there is the march itself.
    one_band, all_bands = (
        _of_standard(front, _outline(bands=bands)).seconds
        for bands in ((13,), (2, 7, 13))
    )
    assert all_bands / 3 < one_band < all_bands


def test_of_scenes_those_with_pixels_alike_count_most(trials):
    """Factors are averaged: between scenes of 0.01 and 0.04 lies 0.02."""
    reference, one = trials[:2]

    def scene(pixel_m: float, error: float) -> Measured:
        trial = replace(one, errors={13: BandError(0.0, error, 0.0)})
        return _measured((reference, trial), _outline(pixel_m=pixel_m))

    front = _front(trials, scenes=(scene(1000.0, 0.01), scene(4000.0, 0.04)))
    errors = [
        _of_standard(front, _outline(pixel_m=m)).error
        for m in (1.0, 1000.0, 2000.0, 4000.0, 1e6)
    ]
    assert errors[2] == pytest.approx(0.02)
    assert errors[1] == pytest.approx(0.01 * 4 ** (1 / 6))
    assert errors[3] == pytest.approx(0.04 / 4 ** (1 / 6))
    # Far from all of them they count alike.
    assert errors[0] == pytest.approx(0.02, rel=0.2)
    assert errors[4] == pytest.approx(0.02, rel=0.2)


def test_a_quality_that_one_scene_lacks_is_not_chosen(trials):
    reference, *others = trials
    scenes = (
        _measured(trials, _outline()),
        _measured((reference, others[0]), _outline()),
    )
    front = _front(trials, scenes=scenes)
    assert _of_standard(front, _outline()).quality == others[0].quality


def test_a_front_serves_scenes_that_see_less():
    whole = replace(KIND, sunlit=True)
    assert whole.serves(KIND)
    assert not KIND.serves(whole)
    assert not whole.serves(replace(whole, source="imagery"))
    assert not whole.serves(replace(whole, light="paper"))
    assert not whole.serves(replace(whole, shaded=True))
    assert str(whole) == "weather in physical light, sunlit thermal"


def test_a_front_is_kept_and_found_again(trials, tmp_path, monkeypatch):
    monkeypatch.setattr(fronts.platformdirs, "user_data_path", lambda _: tmp_path)
    front = _front(trials, kind=replace(KIND, source="nothing that ships"))
    with pytest.raises(DataError, match="cloudjax tradeoff"):
        front_for(front.kind)
    file = keep(front)
    assert file is not None
    found, source = front_for(front.kind)
    assert source == str(file)
    assert found.expected(_outline()) == front.expected(_outline())
    assert found.scenes[0].best == front.scenes[0].best
    file.write_text(file.read_text()[:-100])
    with pytest.raises(DataError, match="measure it"):
        read_front(file)
    file.write_text(json.dumps({"kind": 3}))
    with pytest.raises(DataError, match="measure it"):
        front_for(front.kind)


def test_what_leaves_little_to_choose_is_not_kept(trials, tmp_path, monkeypatch):
    monkeypatch.setattr(fronts.platformdirs, "user_data_path", lambda _: tmp_path)
    assert keep(_front(trials[:3])) is None
    assert not fronts.own_file(KIND).exists()
    # Nor does it take the place of more.
    file = keep(_front(trials))
    assert file is not None
    assert keep(_front(trials[:4])) is None
    assert len(read_front(file).qualities) == len(trials) - 1
    assert keep(_front(trials[:1] + trials[1:][::-1])) == file


def test_the_page_tells_the_front_and_how_to_have_it(trials):
    front = _front(trials)
    page = trade_page(front, "cloudjax render abi-meso-2km --weather gfs.grib2")
    assert "cloudjax render abi-meso-2km --weather gfs.grib2 -o OUT.nc" in page
    for trial in front.scenes[0].best:
        assert f"<code>{trial.quality.words}</code>" in page
    # Nothing is asked of the network.
    assert "http://" not in page.split("base64,")[0]
    assert "https://" not in page.split("base64,")[0]


def test_words_of_a_quality_are_options_of_render():
    quality = Quality(12, 3, shadows=6, scattering=False)
    assert quality.words == "--steps 12 --nodes 3 --shadows 6 --no-scattering"
    assert Trial(quality, 1.0, 0.0, 2.0, {1: BandError(0.0, 0.1, 0.0)}).error == 0.1
