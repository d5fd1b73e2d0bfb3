"""What became of a changed input: right, refused in one true sentence, or told.

Everything else is a fault: another exception, or a result that has changed in silence.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from cloudjax_data import DataError


@dataclass(frozen=True)
class Mutation:
    """A change of an input.

    **Fields:** `name`: what is changed and how; `apply`: makes it, in a folder or of a
    text, as the family of mutations says.
    """

    name: str
    apply: Callable[[Any], Any]

    def __str__(self) -> str:
        return self.name


def fault_of(
    read: Callable[[], Any], difference: Callable[[Any], str | None]
) -> str | None:
    """Read a changed input: what is wrong with what happens, or None.

    **Arguments:** `difference`: what of a result has changed in silence, in words.
    """
    try:
        found = read()
    except DataError as error:
        return fault_of_sentence(str(error))
    except Exception as error:
        return f"ended in {type(error).__name__}: {error}"
    return difference(found)


def fault_of_sentence(text: str) -> str | None:
    """What is wrong with a message to the user, or None."""
    if not text.endswith("."):
        return f"said no sentence: {text!r}"
    if len(text.splitlines()) != 1:
        return f"said more than a line: {text!r}"
    if "Traceback" in text or "object at 0x" in text:
        return f"said what only programs understand: {text!r}"
    if ": " not in text:
        return f"said no remedy: {text!r}"
    return None
