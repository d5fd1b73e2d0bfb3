"""`cloudjax render SENSOR --retrieval`: what reaches the renderer, what is refused."""

import numpy as np
import pytest

from tests.commands import run, sentence_of
from tests.generated_retrieval import START, write_cod, write_retrieval


SENSOR = "abi-meso-10km", "--centre", "34,-107", "--bands", "2,13"
DEPTH = np.full((20, 20), 8.0)
TOPS = np.repeat([[10e3, 10e3, 3e3, 3e3]], 4, axis=0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("retrievals")
    write_retrieval(folder / "scan", DEPTH, TOPS)
    write_retrieval(folder / "clear", np.full((20, 20), np.nan), TOPS)
    write_cod(folder / "half", DEPTH)
    return folder


def _render(folder, name, *options):
    of = "--retrieval", folder / name
    return run("render", *SENSOR, *of, "-o", folder / "out.nc", *options)


@pytest.mark.parametrize("time", [None, "2022-07-01T18:00"])
def test_the_clouds_of_the_scan_reach_the_renderer(folder, asked, time):
    given = ("--steps", 7, *(("--time", time) if time else ()))
    result = _render(folder, "scan", *given)
    assert result.exit_code == 0, (result.output, result.exception)
    ((world, _, moment),) = asked
    assert moment.hour == (18 if time else START.hour)
    assert world.steps == 7
    assert list(world.classes) == ["water", "ice"]
    assert len(world.sources) == 2
    assert world.profiles is None


def test_what_is_not_known_is_told(folder, asked, tmp_path):
    write_retrieval(tmp_path, DEPTH, np.where(TOPS > 5e3, TOPS, np.nan))
    result = _render(tmp_path, "")
    assert asked
    assert "200 of 400 cloudy pixels have no top height" in result.output


REFUSED = {
    "clear": ("clear", (), "has no cloud"),
    "half": ("half", (), "has no ACHA file"),
    "none": ("none", (), "does not exist"),
    "seed": ("scan", ("--seed", "3"), "leave out --seed"),
    "place": ("scan", ("--place", "20,-80"), "leave out --place"),
    "frames": ("scan", ("--frames", "2"), "leave out --frames"),
    "both": ("scan", ("--wrf", "wrfout"), "give one"),
}


@pytest.mark.parametrize(("name", "options", "said"), REFUSED.values(), ids=REFUSED)
def test_what_does_not_serve_ends_in_a_sentence(folder, name, options, said):
    assert said in sentence_of(_render(folder, name, *options))
    assert not (folder / "out.nc").exists()


def test_info_tells_of_a_retrieval(folder):
    result = run("info", folder / "scan")
    assert result.exit_code == 0, result.output
    assert "render SENSOR --retrieval" in result.output
