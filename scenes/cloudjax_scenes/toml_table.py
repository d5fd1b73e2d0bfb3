"""Tables of a TOML file, checked: what is unknown, missing or of the wrong type."""

import difflib
import math
import os
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cloudjax_data import DataError


@dataclass(frozen=True)
class Kind:
    """A kind of value: what it is called in a message, and which values are of it."""

    words: str
    holds: Callable[[Any], bool]


def _is_number(value: Any) -> bool:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return is_number and math.isfinite(value)


def is_whole(value: Any) -> bool:
    """Whether a value is an integer, which true and false are not."""
    return isinstance(value, int) and not isinstance(value, bool)


NUMBER = Kind("a finite number", _is_number)
WHOLE = Kind("a whole number", is_whole)
TEXT = Kind("a text", lambda value: isinstance(value, str))
LIST = Kind("a list", lambda value: isinstance(value, list))


def read_toml(path: str | os.PathLike[str], what: str) -> dict[str, Any]:
    """The content of a file; `what` it should be is said where it is absent.

    **Raises:** `DataError` if the file is absent or no TOML.
    """
    path = Path(path)
    if not path.is_file():
        raise DataError(f"{path} is not a file: give {what}.")
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise DataError(f"{path} is not valid TOML ({error}): correct it.") from error


def checked(
    table: Mapping[str, Any],
    required: Mapping[str, Kind],
    optional: Mapping[str, Kind],
    where: str,
) -> dict[str, Any]:
    """The table, with numbers as floats but where they must be whole.

    **Arguments:** `required`, `optional`: the kind of value by key; `where`: the file
    and table, for the message.

    **Raises:** `DataError` for keys that are unknown or missing, or wrong values.
    """
    known = {**required, **optional}
    for key in table:
        if key not in known:
            near = difflib.get_close_matches(key, known, n=1, cutoff=0.0)[0]
            raise DataError(
                f"{where} has an unknown key, {key!r}: the nearest known one is "
                f"{near!r}."
            )
    missing = [key for key in required if key not in table]
    if missing:
        raise DataError(f"{where} has no {', '.join(missing)}: add what is missing.")
    for key, value in table.items():
        if not known[key].holds(value):
            raise DataError(
                f"{where} gives {key} = {value!r}: make it {known[key].words}."
            )
    return {k: float(v) if known[k] is NUMBER else v for k, v in table.items()}
