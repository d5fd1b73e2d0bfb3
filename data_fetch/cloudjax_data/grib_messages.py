"""Messages of a GRIB file are found, and what else is between them.

eccodes skips what it does not recognise, so that a damaged or shortened file would
merely seem to hold fewer levels.
"""

import mmap
from collections.abc import Iterator
from pathlib import Path

from .errors import DataError
from .grib_sections import BrokenMessageError, message_length, sections


_START, _END = b"GRIB", b"7777"
_EDITIONS = (b"\1", b"\2")
# Spaces, line ends, control characters and zeros: what transfers and disks add.
_PADDING = bytes(range(33)) + b"\x7f\xff"
# Bulletins of weather services put a line or two before a message.
_LONGEST_HEADING = 200
# What says how long a message is.
_HEAD = 16


def message_offsets(path: Path) -> tuple[int, ...]:
    """Return where each message starts, once it is sure that all are whole.

    **Raises:** `DataError` if the file is absent, empty, not GRIB, shortened or
    damaged, or holds something else between or after its messages.
    """
    if not path.is_file():
        raise DataError(f"{path} is not a file: check the path.")
    try:
        if path.stat().st_size == 0:
            raise DataError(f"{path} is empty: download it again.")
        with (
            path.open("rb") as stream,
            mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as content,
        ):
            return tuple(_offsets(path, content))
    except OSError as error:
        raise DataError(
            f"{path} cannot be read ({error.strerror or error}): check its permissions."
        ) from error


def is_grib(path: Path) -> bool:
    """Tell by its first bytes whether a file begins with a message, or its heading."""
    with path.open("rb") as stream:
        content = stream.read(_LONGEST_HEADING + _HEAD)
    start = content.find(_START)
    if start < 0:
        return False
    # Of a text that speaks of GRIB no byte is 1 or 2.
    known = content[start + 7 : start + 8] in _EDITIONS
    return start == 0 or (known and _is_heading(content[:start]))


def _offsets(path: Path, content: mmap.mmap) -> Iterator[int]:
    size, end, number = len(content), 0, 0
    while (start := content.find(_START, end)) >= 0:
        if not _is_heading(content[end:start]):
            raise DataError(_not_grib(path, end))
        head = content[start : start + _HEAD]
        if head[7:8] not in (b"", *_EDITIONS):
            raise DataError(_not_grib(path, start if number else 0))
        number += 1
        length = _length(content, start)
        if length is None or start + length > size:
            raise DataError(
                f"{path} is truncated: it ends at byte {size}, within its message "
                f"{number} that starts at byte {start}, download it again."
            )
        end = start + length
        if length < _HEAD or content[end - 4 : end] != _END:
            raise DataError(
                f"{path} is damaged: its message {number}, at byte {start}, does not "
                "end where it says, download it again."
            )
        try:
            sections(content, start, end)
        except BrokenMessageError as error:
            raise DataError(
                f"{path} is damaged: the sections of its message {number}, at byte "
                f"{start}, do not fit into it, download it again."
            ) from error
        yield start
    if not number or content[end:].strip(_PADDING):
        raise DataError(_not_grib(path, end))


def _length(content: mmap.mmap, start: int) -> int | None:
    """The bytes of a message; None where the file ends before that is told."""
    try:
        return message_length(content, start)
    except BrokenMessageError:
        return None


def _is_heading(between: bytes) -> bool:
    """Tell whether it is a heading or padding, of any length."""
    if not between.strip(_PADDING):
        return True
    text = all(byte < 128 for byte in between)
    return len(between) <= _LONGEST_HEADING and text and _END not in between


def _not_grib(path: Path, position: int) -> str:
    if position == 0:
        return f"{path} is not a GRIB file: use a GFS or NAM analysis."
    return (
        f"{path} has at byte {position} something that is no GRIB message: it is "
        "truncated or damaged, download it again."
    )
