"""Spoilt settings and classes of cloud: what is taken is what the text says."""

import dataclasses
import math
import tomllib
from pathlib import Path
from typing import Any

import pytest

from cloudjax import class_table, load_classes
from cloudjax_fit.fit_inputs import FitInputs, read_inputs
from cloudjax_scenes.data_errors import data_errors
from cloudjax_scenes.sensors import read_sensor
from tests.mutations.toml_mutations import toml_mutations
from tests.mutations.verdict import Mutation, fault_of
from tests.scenes import write_scene


EXAMPLE = Path(__file__).parents[2] / "docs" / "classes_example.toml"
SETTINGS = """
[fit]
bands = [1, 3, 13]
rays = 4096
steps = 12
starts = 2
max_steps = 90
seed = 7
light = "paper"

[rule]
bright_band = 1
bright_reflectance = 0.3
cold_band = 13
cold_temperature_k = 265.0

[parameters."low_stratus.threshold"]
default = 0.1
lower = -3.0
upper = 3.5
spread = 0.6
free = true
"""
SENSOR = """
kind = "camera"
latitude_deg = 25.0
longitude_deg = -88.5
altitude_m = 500e3
azimuth_deg = 0.0
elevation_deg = -90.0
roll_deg = 0.0
field_of_view_deg = 5.0
rows = 40
columns = 40
name = "look"

[[bands]]
number = 13
wavelength_um = 10.33
fk1 = 10803.3
fk2 = 1392.74
bc1 = 0.0755
bc2 = 0.99975

[[bands]]
number = 2
solar_irradiance_w_m2_um = 1631.3351
"""


def content_of(file: Path) -> dict[str, Any]:
    """By Python's own parser."""
    return tomllib.loads(file.read_bytes().decode("utf-8-sig"))


def settings_difference(inputs: FitInputs, file: Path) -> str | None:
    said, taken = content_of(file), inputs.settings
    fit = dict(said.get("fit", {}))
    bands = fit.pop("bands", list(taken.bands or []))
    if list(taken.bands or []) != sorted({bands} if is_whole(bands) else set(bands)):
        return f"uses the bands {taken.bands}"
    for key, value in fit.items():
        if getattr(taken.fit, key, taken.classes) != value:
            return f"takes {key} for {getattr(taken.fit, key)}"
    rule = dataclasses.asdict(inputs.target.imagery.rule)
    for key, value in said.get("rule", {}).items():
        if _difference(None if value is False else value, rule[key]):
            return f"takes {key} for {rule[key]}"
    by_name = {p.name: p for p in inputs.parameters}
    # Those of other bands and classes than the scene has are left out.
    held = {n: t for n, t in said.get("parameters", {}).items() if n in by_name}
    for name, table in held.items():
        for key, value in table.items():
            if _difference(value, getattr(by_name[name], key)):
                return f"takes {key} of {name} for {getattr(by_name[name], key)}"
    return None


def is_whole(value: Any) -> bool:
    return isinstance(value, int)


def class_difference(classes: dict, file: Path) -> str | None:
    said = content_of(file)
    if list(said) != list(classes):
        return f"has the classes {list(classes)}"
    for name, one in classes.items():
        where = _difference(said[name], class_table(one))
        if where:
            return f"takes {name} {where}"
    return None


def _difference(said: Any, taken: Any) -> str | None:
    """Where what was taken is not what was said; more may have been taken."""
    if isinstance(said, dict):
        for key, value in said.items():
            where = _difference(value, taken.get(key)) if taken else "for nothing"
            if where:
                return f"{key} {where}"
        return None
    if isinstance(said, list):
        pairs = zip(said, taken, strict=True)
        return next((w for a, b in pairs if (w := _difference(a, b))), None)
    same = said == taken
    if isinstance(said, float | int) and isinstance(taken, float | int):
        same = math.isclose(said, taken, rel_tol=1e-6)
    return None if same else f"for {taken!r}"


def sensor_difference(sensor: Any, file: Path) -> str | None:
    said = content_of(file)
    held = said.get("bands", [])
    numbers = [b["number"] if isinstance(b, dict) else b for b in held]
    if numbers and sorted(sensor.bands) != sorted(numbers):
        return "has other bands"
    name = said.get("name", sensor.name)
    return None if sensor.name == name else f"is called {sensor.name}"


@pytest.fixture(scope="module")
def scene(tmp_path_factory) -> Path:
    return write_scene(tmp_path_factory.mktemp("scene"))


@pytest.fixture
def families(scene, tmp_path):
    def settings(content: bytes):
        (scene / "scene.toml").write_bytes(content)
        return read_inputs(scene), scene / "scene.toml"

    def classes(content: bytes):
        (tmp_path / "classes.toml").write_bytes(content)
        with data_errors():
            return load_classes(tmp_path / "classes.toml"), tmp_path / "classes.toml"

    def sensor(content: bytes):
        (tmp_path / "sensor.toml").write_bytes(content)
        return read_sensor(tmp_path / "sensor.toml"), tmp_path / "sensor.toml"

    return {
        "settings": (SETTINGS, settings, settings_difference),
        "classes": (EXAMPLE.read_text("utf-8"), classes, class_difference),
        "sensor": (SENSOR, sensor, sensor_difference),
    }


def faults(family, mutations: list[Mutation]) -> list[str]:
    """All that goes wrong with changed texts, in words."""
    text, read, difference = family
    assert difference(*read(text.encode())) is None
    found = []
    for mutation in mutations:
        content = mutation.apply(text)
        fault = fault_of(
            lambda content=content: read(content),
            lambda result: difference(*result),
        )
        if fault is not None:
            found.append(f"{mutation}: {fault}")
    return found


@pytest.mark.parametrize("name", ["settings", "classes", "sensor"])
def test_a_few_spoilt_tables(families, name):
    every = toml_mutations(families[name][0], keys=20)
    assert len(every) > 150
    assert faults(families[name], every[::43]) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", ["settings", "classes", "sensor"])
def test_spoilt_tables(families, name):
    assert faults(families[name], toml_mutations(families[name][0], keys=40)) == []
