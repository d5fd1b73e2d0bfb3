"""What users write in scene.toml, taken as meant or refused in a sentence."""

import dataclasses
import tomllib

import click
import pytest
from tests.scenes import write_scene

from cloudjax_cli.fit import fit
from cloudjax_data import DataError
from cloudjax_fit.fit_inputs import read_inputs
from cloudjax_fit.fit_settings import QUALITIES, FitSettings
from cloudjax_fit.scene_parameters import scene_parameters
from cloudjax_fit.settings import (
    Settings,
    changed_parameters,
    cloud_rule,
    concerning,
    read_settings,
    with_options,
)
from cloudjax_scenes.cloud_rule import CloudRule
from cloudjax_scenes.lights import PAPER, PHYSICAL


SOURCE = "folder/scene.toml"


@pytest.fixture(scope="module")
def made_of(tmp_path_factory):
    scene = write_scene(tmp_path_factory.mktemp("scene"), bands=(1, 13))
    return read_inputs(scene).made_of


def read(text: str) -> Settings:
    return read_settings(tomllib.loads(text), SOURCE)


def test_everything_that_may_be_set():
    settings = read("""
        [fit]
        bands = [13, 1]
        classes = "mine.toml"
        rays = 100
        max_steps = 7
        [rule]
        cold_band = false
        bright_reflectance = 1
        [parameters."low_stratus.threshold"]
        default = 1
        free = false
    """)
    assert settings.bands == (1, 13)
    assert settings.classes == "mine.toml"
    assert settings.fit == FitSettings(rays=100, max_steps=7)
    assert settings.rule == {"cold_band": None, "bright_reflectance": 1.0}
    assert settings.parameters == {
        "low_stratus.threshold": {"default": 1.0, "free": False}
    }


def test_nothing_set_is_the_default():
    assert read("") == Settings(source=SOURCE)


@pytest.mark.parametrize(
    ("text", "named", "near"),
    [
        ("[fitt]", "'fitt'", "'fit'"),
        ("[fit]\nray = 3", "'ray'", "'rays'"),
        ("[rule]\ncold_temperature = 3.0", "'cold_temperature'", "cold_temperature_k"),
        ("[parameters.a]\nvalue = 3", "'value'", ""),
    ],
)
def test_an_unknown_key_is_named_with_the_nearest(text, named, near):
    with pytest.raises(DataError) as caught:
        read(text)
    for part in (SOURCE, named, near):
        assert part in str(caught.value)


@pytest.mark.parametrize(
    "text",
    [
        "fit = 3",
        "[fit]\nrays = 0",
        "[fit]\nrays = 1.5",
        "[fit]\nseed = -1",
        "[fit]\nbands = []",
        "[fit]\nclasses = 3",
        "[fit]\nbands = [17]",
        '[fit]\nbands = "13"',
        "[rule]\ncold_band = true",
        "[rule]\nbright_band = 0",
        '[rule]\nbright_reflectance = "high"',
        "[rule]\nbright_reflectance = nan",
        "[parameters]\na = 3",
        "[parameters.a]\nfree = 1",
        "[parameters.a]\ndefault = true",
        "[parameters.a]\nspread = 0.0",
    ],
)
def test_a_value_of_the_wrong_kind_is_refused(text):
    with pytest.raises(DataError, match=SOURCE):
        read(text)


def test_the_command_line_goes_before_the_file():
    settings = read("[fit]\nrays = 100\nseed = 3")
    settings = with_options(settings, {"rays": 50, "seed": None, "starts": 2})
    assert settings.fit == FitSettings(rays=50, seed=3, starts=2)
    with pytest.raises(DataError, match="command line gives rays = 0"):
        with_options(settings, {"rays": 0})


def test_a_quality_stands_for_rays_and_steps():
    settings = read("[fit]\nrays = 100\nsteps = 3\nseed = 3")
    for name, chosen in QUALITIES.items():
        found = with_options(settings, {"quality": name, "starts": 2}).fit
        rays, steps = chosen["rays"], chosen["steps"]
        assert found == FitSettings(rays=rays, steps=steps, seed=3, starts=2)
    costs = [chosen["rays"] * chosen["steps"] for chosen in QUALITIES.values()]
    assert costs == sorted(set(costs))
    with pytest.raises(DataError, match="--quality and --steps both choose: give one"):
        with_options(settings, {"quality": "draft", "steps": 3})
    with pytest.raises(DataError, match="quality = 'best': make it draft or standard"):
        with_options(settings, {"quality": "best"})


def test_the_command_line_knows_all_qualities():
    (option,) = (p for p in fit.params if p.name == "quality")
    assert isinstance(option.type, click.Choice)
    assert [*option.type.choices] == [*QUALITIES]


def test_every_option_of_a_fit_is_on_the_command_line():
    from cloudjax_cli.demo import demo

    names = {field.name for field in dataclasses.fields(FitSettings)}
    assert names <= {parameter.name for parameter in demo.params}


def test_a_rule_is_changed_in_parts():
    settings = read("[rule]\ncold_temperature_k = 255.0")
    assert cloud_rule(settings, [1, 3, 13]) == CloudRule(1, 0.25, 13, 255.0)
    settings = read("[rule]\nbright_band = 3\ncold_band = false")
    assert cloud_rule(settings, [1, 3, 13]) == CloudRule(3, 0.35, None, 270.0)
    assert cloud_rule(read(""), [1, 13]) is None


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("bright_band = 5", "not among the bands 1, 4, 13"),
        ("bright_band = 4", "set bright_reflectance too"),
        ("bright_band = false\ncold_band = false", "no band that tells cloud"),
    ],
)
def test_a_rule_that_cannot_be_applied_is_refused(text, words):
    with pytest.raises(DataError, match=words):
        cloud_rule(read(f"[rule]\n{text}"), [1, 4, 13])


def test_parameters_are_changed(made_of):
    settings = read('[parameters."cirrus.top"]\ndefault = 9000\nfree = false')
    parameters = changed_parameters(settings, made_of)
    (top,) = (p for p in parameters if p.name == "cirrus.top")
    assert (top.default, top.free) == (9000.0, False)


def test_an_unknown_parameter_is_named_with_the_nearest(made_of):
    settings = read('[parameters."cirus.top"]\ndefault = 9000')
    with pytest.raises(DataError, match=r"'cirus\.top'.*'cirrus\.top'"):
        changed_parameters(settings, made_of)


def test_a_parameter_beyond_its_bounds_is_refused(made_of):
    settings = read('[parameters."cirrus.top"]\ndefault = 90000')
    with pytest.raises(DataError, match=r"scene\.toml: cirrus\.top = 90000"):
        changed_parameters(settings, made_of)


def test_parameters_of_bands_that_are_not_used_are_left_out(made_of):
    assert "air.gain_C13" in [p.name for p in scene_parameters(made_of)]
    changes = {"air.gain_C13": 1.0, "air.gain_C15": 1.0}
    assert concerning(changes, made_of, SOURCE) == {"air.gain_C13": 1.0}


def test_parameters_of_another_light_are_left_out(made_of):
    changes = {"light.indirect": 0.2}
    for light, expected in ((PAPER, changes), (PHYSICAL, {})):
        lit = dataclasses.replace(made_of, light=light, known=made_of.available)
        assert concerning(changes, lit, SOURCE) == expected


def test_an_unknown_light_is_refused():
    with pytest.raises(DataError, match=r"light = 'moon': make it paper or physical"):
        read_settings({"fit": {"light": "moon"}}, SOURCE)
