"""Fitted parameters as a TOML file: a set of classes, and what else was fitted.

    light_strategy = "physical"

    [air]
    gain_C13 = 1.01

    [low_stratus]
    threshold = 0.31
    ...

`cloudjax render SENSOR --classes` takes it as it is, in physical terms. Files of
earlier versions hold numbers by short names only, in the units of their light.
"""

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import tomli_w

from cloudjax import CloudClass, Prior, class_table
from cloudjax.clouds.class_files import classes_from
from cloudjax.toml_table import NUMBER, TABLE, TEXT, TomlError, one_of, read_toml
from cloudjax_scenes.data_errors import data_errors
from cloudjax_scenes.lights import LIGHTS, Light

from .parameters import Parameter
from .scene_parameters import light_factor


LIGHT = "light_strategy"


@dataclass(frozen=True, eq=False)
class FittedParameters:
    """What a file of fitted parameters holds.

    **Fields:**

    - `source`: the file, to be named in errors.
    - `values`: by name, such as "air.gain_C13"; of an earlier version also those of the
      clouds.
    - `light`: the name of the strategy for light; None where the file does not say.
    - `classes`: of cloud, with the fitted values; None in files of earlier versions.
    """

    source: str
    values: dict[str, float]
    light: str | None
    classes: dict[str, CloudClass] | None


def parameters_text(
    classes: Iterable[CloudClass],
    values: Mapping[Parameter, float],
    light: Light,
    title: str,
) -> str:
    """Return the content of the file, under a title of one line.

    **Arguments:** `values`: of all parameters of the scene, those of the classes too.
    """
    tables: dict[str, Any] = {LIGHT: light.name}
    classes = list(classes)
    names = [one.name for one in classes]
    for parameter, value in values.items():
        section, _, key = parameter.name.partition(".")
        if section not in names:
            tables.setdefault(section, {})[key] = value
    by_name = {p.name: (p, value) for p, value in values.items()}
    tables |= {one.name: class_table(_fitted(one, by_name, light)) for one in classes}
    return f"# {title}\n\n{tomli_w.dumps(tables)}"


def _fitted(
    one: CloudClass, found: Mapping[str, tuple[Parameter, float]], light: Light
) -> CloudClass:
    """The class with the values and the priors of the fit, in physical terms."""
    values, priors = {}, dict(one.priors)
    for each in one.parameters:
        name = f"{one.name}.{each.name}"
        if name not in found:
            continue
        parameter, value = found[name]
        factor = light_factor(each.key, light)
        values[each.name] = value / factor
        priors[each.key] = Prior(
            parameter.lower / factor,
            parameter.upper / factor,
            parameter.spread,
            parameter.log,
            parameter.free,
        )
    return replace(one.with_values(values), priors=priors)


@data_errors()
def read_parameters(path: str | os.PathLike[str]) -> FittedParameters:
    """Read a file that a fit wrote, or that is laid out in that way.

    **Raises:** `DataError` if the file is absent, no TOML, or holds anything but
    classes of cloud and sections of numbers.
    """
    content, source = read_toml(path, "the parameters.toml of a fit"), str(path)
    light = content.pop(LIGHT, None)
    if light is not None:
        TEXT.check(light, LIGHT, source)
        one_of(list(LIGHTS)).check(light, LIGHT, source)
    for name, table in content.items():
        if not TABLE.holds(table):
            raise TomlError(
                f"{source} gives {name!r} outside of a section: write it as in the "
                "parameters.toml of a fit."
            )
    clouds = {name: table for name, table in content.items() if "textures" in table}
    values = {
        f"{section}.{key}": NUMBER.check(value, f"{section}.{key}", source)
        for section, table in content.items()
        if section not in clouds
        for key, value in table.items()
    }
    return FittedParameters(
        source, values, light, classes_from(clouds, source) if clouds else None
    )
