"""Text for terminals whose encoding lacks some of its letters."""

import codecs
import sys


# As they are typed where there is nothing better.
_SPELT = {
    "µ": "u",
    "μ": "u",
    "−": "-",
    "×": "x",
    "÷": "/",
    "±": "+/-",
    "°": " deg",
    "²": "2",
    "³": "3",
    "…": "...",
    "“": '"',
    "”": '"',
    "’": "'",
    "–": "-",
    "—": "-",
    "━": "-",
    "╸": "-",
    "╺": "-",
    "•": "*",
}


def forgive_encodings() -> None:
    """Let no letter that a stream cannot encode end the program."""
    codecs.register_error("cloudjax", _spelt)
    for stream in (sys.stdout, sys.stderr):
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors="cloudjax")


def _spelt(error: UnicodeError) -> tuple[str, int]:
    assert isinstance(error, UnicodeEncodeError)
    letters = error.object[error.start : error.end]
    return "".join(
        _SPELT.get(letter) or _escaped(letter) for letter in letters
    ), error.end


def _escaped(letter: str) -> str:
    """A letter as it is written in a program; bytes that were none as `\\xff`."""
    code = ord(letter)
    if 0xDC80 <= code <= 0xDCFF:
        return f"\\x{code - 0xDC00:02x}"
    return letter.encode("ascii", "backslashreplace").decode("ascii")
