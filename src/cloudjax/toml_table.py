"""Tables of a TOML file, checked: what is unknown, missing or of the wrong type.

Every message is one sentence that names the file, the key and the remedy.
"""

import codecs
import difflib
import math
import os
import tomllib
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any


class TomlError(ValueError):
    """A file or table that cannot be used; the message is a sentence for the user."""


# UTF-32 first, whose mark begins with that of UTF-16.
_MARKS = {
    codecs.BOM_UTF32_LE: "UTF-32",
    codecs.BOM_UTF32_BE: "UTF-32",
    codecs.BOM_UTF16_LE: "UTF-16",
    codecs.BOM_UTF16_BE: "UTF-16",
}
# Floats of 32 bits end at 3e38, and their products with others sooner.
_LARGEST = 1e30


@dataclass(frozen=True)
class Kind:
    """A kind of value: what it is called in a message, and which values are of it."""

    words: str
    holds: Callable[[Any], bool]

    def check(self, value: Any, key: str, where: str) -> Any:
        """Return the value, numbers as floats where they need not be whole.

        **Raises:** `TomlError` for a value of another kind.
        """
        if not self.holds(value):
            raise TomlError(f"{where} gives {key} = {value!r}: make it {self.words}.")
        if self is NUMBERS:
            return [float(one) for one in value]
        return float(value) if self in (NUMBER, ANY_NUMBER, POSITIVE) else value


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_finite(value: Any) -> bool:
    return _is_number(value) and abs(value) <= _LARGEST


def is_whole(value: Any) -> bool:
    """Tell whether a value is an integer, which true and false are not."""
    return isinstance(value, int) and not isinstance(value, bool)


NUMBER = Kind("a finite number, within 1e30", _is_finite)
ANY_NUMBER = Kind(
    "a number, within 1e30 or infinite",
    lambda value: _is_finite(value) or (_is_number(value) and abs(value) == math.inf),
)
POSITIVE = Kind(
    "a positive number, within 1e30", lambda value: _is_finite(value) and value > 0
)
WHOLE = Kind("a whole number", is_whole)
TEXT = Kind("a text", lambda value: isinstance(value, str))
LIST = Kind("a list", lambda value: isinstance(value, list))
NUMBERS = Kind(
    "a list of finite numbers, within 1e30",
    lambda value: isinstance(value, list) and all(_is_finite(x) for x in value),
)
FLAG = Kind("true or false", lambda value: isinstance(value, bool))
TABLE = Kind("a table", lambda value: isinstance(value, Mapping))


def least(number: int) -> Kind:
    """Return the kind of whole numbers that are not less than this."""
    words = f"a whole number of at least {number}"
    return Kind(words, lambda value: is_whole(value) and value >= number)


def within(least: int, most: int) -> Kind:
    """Return the kind of whole numbers from one to another."""
    words = f"a whole number from {least} to {most}"
    return Kind(words, lambda value: is_whole(value) and least <= value <= most)


def one_of(words: Collection[str]) -> Kind:
    """Return the kind of texts that are one of these."""
    return Kind(" or ".join(words), lambda value: value in list(words))


def read_toml(path: str | os.PathLike[str], what: str) -> dict[str, Any]:
    """Return the content of a file; `what` it should be is said where it is absent.

    **Raises:** `TomlError` if the file is absent or no TOML.
    """
    path = Path(path)
    if not path.is_file():
        raise TomlError(f"{path} is not a file: give {what}.")
    return parse_toml(_text(path.read_bytes(), str(path)), str(path))


def _text(content: bytes, source: str) -> str:
    """The content of a file as text; the byte-order mark of some editors is skipped."""
    for mark, name in _MARKS.items():
        if content.startswith(mark):
            raise TomlError(
                f"{source} is text in {name}, and TOML is in UTF-8: save it as UTF-8."
            )
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise TomlError(
            f"{source} is not text in UTF-8 ({error}): save it as UTF-8."
        ) from error


def parse_toml(text: str, source: str) -> dict[str, Any]:
    """Return the content of a text; `source` is the name of its file.

    **Raises:** `TomlError` if it is no TOML.
    """
    try:
        return tomllib.loads(text)
    # Numbers of thousands of digits are a ValueError of another kind.
    except ValueError as error:
        raise TomlError(f"{source} is not valid TOML ({error}): correct it.") from error
    except RecursionError as error:
        raise TomlError(
            f"{source} is nested too deeply: it is not what it should be, correct it."
        ) from error


def checked(
    table: Any,
    required: Mapping[str, Kind],
    optional: Mapping[str, Kind],
    where: str,
) -> dict[str, Any]:
    """Return the table, with numbers as floats but where they must be whole.

    **Arguments:** `required`, `optional`: the kind of value by key; `where`: the file
    and table, for the message.

    **Raises:** `TomlError` for keys that are unknown or missing, or wrong values.
    """
    known = {**required, **optional}
    if not TABLE.holds(table):
        raise TomlError(f"{where} must be a table, with {', '.join(known)}.")
    require_known(table, known, "key", where)
    missing = [key for key in required if key not in table]
    if missing:
        raise TomlError(f"{where} has no {', '.join(missing)}: add what is missing.")
    return {key: known[key].check(value, key, where) for key, value in table.items()}


def require_known(
    given: Collection[str], known: Collection[str], what: str, where: str
) -> None:
    """Raise `TomlError` for the first name that is not known, with the nearest one."""
    for name in given:
        if name not in known:
            raise TomlError(
                f"{where} has an unknown {what}, {name!r}: the nearest known one is "
                f"{nearest(name, known)!r}."
            )


def nearest(name: str, known: Collection[str]) -> str:
    """Return the known name that is spelt most alike."""
    return difflib.get_close_matches(name, list(known), n=1, cutoff=0.0)[0]
