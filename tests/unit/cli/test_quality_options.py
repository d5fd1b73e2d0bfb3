"""Qualities that are asked of `cloudjax render`, and what is said of them."""

import pickle

import click
import pytest

from cloudjax_cli.quality_options import AskedQuality, Share
from cloudjax_data import DataError
from cloudjax_scenes.quality import DRAFT, STANDARD, Quality
from cloudjax_scenes.trade import fronts
from cloudjax_scenes.trade.fronts import Front
from cloudjax_scenes.trade.machine import Machine
from cloudjax_scenes.trade.measured import Measured
from cloudjax_scenes.trade.outline import Kind, Outline
from cloudjax_scenes.trade.trial import BandError, Trial
from tests.commands import run, sentence_of
from tests.weather_scenes import MESO, write_inputs


@pytest.fixture(scope="module")
def weather(tmp_path_factory):
    return write_inputs(tmp_path_factory.mktemp("weather"))


@pytest.fixture
def worlds(monkeypatch):
    """The worlds that would have been rendered."""
    asked = []

    def render_strips(world, *others, **options):
        del others, options
        asked.append(world)
        return []

    monkeypatch.setattr("cloudjax_scenes.image_strips.render_strips", render_strips)
    monkeypatch.setattr("cloudjax_scenes.image_strips.write_strips", lambda *_: None)
    return asked


def _trial(steps: int, seconds: float, error: float) -> Trial:
    errors = {number: BandError(0.0, error, 0.0) for number in (2, 13)}
    return Trial(Quality(steps, 3), seconds, 0.0, 9.0, errors)


def _front(kind: Kind) -> Front:
    scene = Measured(
        name="a disc",
        outline=Outline(kind, (2, 13), 2000.0, 100 * 100),
        sample=100,
        reference=_trial(96, 99.0, 0.0),
        trials=(_trial(6, 1.0, 0.08), _trial(12, 2.0, 0.03), _trial(24, 4.0, 0.01)),
    )
    return Front(kind, Machine("2 cores", Machine.here().work_s), (scene,))


@pytest.fixture
def asked_kinds(monkeypatch):
    kinds = []

    def front_for(kind):
        kinds.append(kind)
        return _front(kind), "of this test"

    monkeypatch.setattr(fronts, "front_for", front_for)
    return kinds


def _render(weather, *options):
    files = "--weather", weather / "gfs.grib2", "--classes", weather / "classes.toml"
    return run("render", *MESO, *files, "-o", weather / "out.nc", *options)


def test_a_quality_by_name_is_that_of_the_world(weather, worlds):
    result = _render(weather, "--quality", "draft", "--shadows", 2)
    assert result.exit_code == 0, result.output
    (world,) = worlds
    assert (world.steps, world.nodes) == (DRAFT.steps, DRAFT.nodes)
    assert world.shadows == 2


def test_a_quality_by_hand_is_that_of_the_world(weather, worlds):
    result = _render(weather, "--nodes", 2, "--no-scattering")
    assert result.exit_code == 0, result.output
    (world,) = worlds
    assert (world.steps, world.nodes) == (STANDARD.steps, 2)
    assert not world.scattering


@pytest.mark.parametrize(
    ("option", "steps", "said"),
    [("--max-error=5%", 12, "an error of 3.00%"), ("--max-seconds=1000", 24, "1.00%")],
)
def test_a_front_chooses_and_the_program_says_what(
    weather, worlds, asked_kinds, option, steps, said
):
    result = _render(weather, option, "--bands", "2,13")
    assert result.exit_code == 0, result.output
    (world,) = worlds
    assert (world.steps, world.nodes) == (steps, 3)
    assert said in result.output
    assert "of this test" in result.output
    assert "rendered in" in result.output
    (kind,) = asked_kinds
    assert str(kind) == "weather in physical light, sunlit thermal"


def test_what_the_front_cannot_do_ends_before_any_work(weather, worlds, asked_kinds):
    del asked_kinds
    result = _render(weather, "--max-error", "0.1%")
    assert result.exit_code == 2
    assert "1.00%" in sentence_of(result)
    assert worlds == []


@pytest.mark.parametrize(
    "both",
    [
        ("--quality=draft", "--steps=3"),
        ("--max-error=2%", "--max-seconds=3"),
        ("--max-error=2%", "--nodes=3"),
    ],
)
def test_two_ways_to_choose_are_refused(weather, worlds, both):
    result = _render(weather, *both)
    assert result.exit_code == 2
    assert "give one" in sentence_of(result)
    assert worlds == []


def test_shares_are_read_as_per_cent_or_as_numbers():
    assert Share().convert("2%", None, None) == pytest.approx(0.02)
    assert Share().convert("0.02", None, None) == pytest.approx(0.02)
    for wrong in ("2", "0", "-1%", "nan", "much"):
        with pytest.raises(click.BadParameter):
            Share().convert(wrong, None, None)


def test_what_is_asked_travels_to_other_processes():
    asked = AskedQuality(quality="reference", shadows=3)
    found = pickle.loads(pickle.dumps(asked))
    assert found.by_hand(STANDARD) == Quality(64, 15, shadows=3)


def test_a_front_for_a_kind_that_nobody_measured_is_told(monkeypatch, tmp_path):
    monkeypatch.setattr(fronts.platformdirs, "user_data_path", lambda _: tmp_path)
    kind = Kind("nowhere", "physical", sunlit=True, thermal=True, shaded=False)
    outline = Outline(kind, (2,), 2000.0, 100)
    with pytest.raises(DataError, match="cloudjax tradeoff"):
        AskedQuality(max_error=0.02).by_measure(outline)
