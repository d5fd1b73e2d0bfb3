"""Fitted parameters as a small TOML file that people read and `render` takes.

[low_stratus]
threshold = 0.31
"""

import os
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomli_w

from cloudjax_data import DataError

from .fitted_scene import LIGHTS


LIGHT = "light_strategy"


def parameters_text(values: Mapping[str, float], title: str, light: str) -> str:
    """The content of the file, under a title of one line.

    **Arguments:** `light`: the strategy that gives extinction its meaning.
    """
    tables: dict[str, Any] = {LIGHT: light}
    for name, value in values.items():
        section, _, key = name.partition(".")
        tables.setdefault(section, {})[key] = value
    return f"# {title}\n\n{tomli_w.dumps(tables)}"


def read_parameters(
    path: str | os.PathLike[str],
) -> tuple[dict[str, float], str | None]:
    """Values by name, such as "low_stratus.threshold", and the strategy for light.

    **Raises:** `DataError` if the file is absent, no TOML, or holds anything but
    sections of numbers.
    """
    path = Path(path)
    if not path.is_file():
        raise DataError(f"{path} is not a file: give the parameters.toml of a fit.")
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise DataError(f"{path} is not valid TOML ({error}): correct it.") from error
    values, light = {}, content.pop(LIGHT, None)
    if light is not None and light not in LIGHTS:
        raise DataError(
            f"{path} gives {LIGHT} = {light!r}: make it {' or '.join(LIGHTS)}."
        )
    for section, table in content.items():
        if not isinstance(table, Mapping):
            raise DataError(
                f"{path} gives {section!r} outside of a section: write it as in the "
                "parameters.toml of a fit."
            )
        for key, value in table.items():
            if isinstance(value, bool) or not isinstance(value, int | float):
                raise DataError(
                    f"{path} gives {section}.{key} = {value!r}: give a number."
                )
            values[f"{section}.{key}"] = float(value)
    return values, light
