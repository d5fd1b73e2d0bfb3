"""The sections of a GRIB message are walked by the lengths and numbers that they give.

A library that believes a wrong length reads and frees memory that is not its own, which
ends the whole program.
"""

import mmap
from collections.abc import Iterator
from dataclasses import dataclass


Content = bytes | mmap.mmap

_END = b"7777"
# Bytes before the first section, by edition.
_HEAD = {1: 8, 2: 16}
# Of edition 1: the fewest bytes of each section, and the flag of those that may lack.
_SECTIONS_1 = {1: (28, 0), 2: (6, 0x80), 3: (6, 0x40), 4: (11, 0)}
# Its longest messages are counted in units of 120 bytes, and what is too much stands
# where the length of the data should be.
_LONG, _UNIT = 0x800000, 120
# Of edition 2: the fewest bytes of each section, and what may follow it. Several fields
# share what is before them.
_SHORTEST_2 = {1: 21, 2: 5, 3: 14, 4: 9, 5: 11, 6: 6, 7: 5}
_NEXT_2 = {0: {1}, 1: {2, 3}, 2: {3}, 3: {4}, 4: {5}, 5: {6}, 6: {7}, 7: {2, 3, 4}}


@dataclass(frozen=True)
class Section:
    """A `Section` is a part of a message: its number, first byte and length."""

    number: int
    start: int
    length: int

    @property
    def end(self) -> int:
        """The byte after its last one."""
        return self.start + self.length


class BrokenMessageError(Exception):
    """Sections are out of order, too short, or longer than their message."""


def message_length(content: Content, start: int) -> int:
    """Return the bytes of a message by its own account.

    **Raises:** `BrokenMessageError` where the content ends before it says.
    """
    if start + _HEAD[2] > len(content):
        raise BrokenMessageError
    if content[start + 7] == 2:
        return number_at(content, start + 8, 8)
    length = number_at(content, start + 4, 3)
    if not length & _LONG:
        return length
    at = start + _HEAD[1]
    for number, (_, flag) in _SECTIONS_1.items():
        if number < 4 and _is_there(content, start, flag):
            at += number_at(content, at, 3)
    excess = number_at(content, at, 3)
    if excess >= _UNIT:
        return length
    return (length - _LONG) * _UNIT - excess + len(_END)


def sections(content: Content, start: int, end: int) -> tuple[Section, ...]:
    """Return the sections of a message from one byte to another.

    **Raises:** `BrokenMessageError` if they do not fill it, in an order that exists.
    """
    if content[start + 7] == 2:
        return tuple(_sections_2(content, start, end - len(_END)))
    return tuple(_sections_1(content, start, end - len(_END)))


def _sections_1(content: Content, start: int, end: int) -> Iterator[Section]:
    at, in_units = start + _HEAD[1], number_at(content, start + 4, 3) & _LONG
    for number, (shortest, flag) in _SECTIONS_1.items():
        if not _is_there(content, start, flag):
            continue
        length = number_at(content, at, 3)
        if number == 4 and in_units and length < _UNIT:
            length = end - at
        if length < shortest or at + length > end:
            raise BrokenMessageError
        yield Section(number, at, length)
        at += length
    # Some pad messages to whole words.
    if content[at:end].strip(b"\0"):
        raise BrokenMessageError


def _sections_2(content: Content, start: int, end: int) -> Iterator[Section]:
    at, last = start + _HEAD[2], 0
    while at < end:
        length, number = number_at(content, at, 4), content[at + 4]
        known = number in _NEXT_2[last] and length >= _SHORTEST_2[number]
        if not known or at + length > end:
            raise BrokenMessageError
        yield Section(number, at, length)
        at, last = at + length, number
    if last != 7:
        raise BrokenMessageError


def _is_there(content: Content, start: int, flag: int) -> bool:
    return not flag or bool(content[start + _HEAD[1] + 7] & flag)


def number_at(content: Content, at: int, size: int) -> int:
    """Return the unsigned integer that stands at a byte.

    **Raises:** `BrokenMessageError` where the content ends before it does.
    """
    if at + size > len(content):
        raise BrokenMessageError
    return int.from_bytes(content[at : at + size])
