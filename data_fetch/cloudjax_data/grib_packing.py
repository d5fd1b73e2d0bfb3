"""The values of a GRIB message are counted before they are unpacked.

A library that is told of more values, or of wider ones, than a message holds reads what
is not its own: other values, or none and the end of the whole program.
"""

from collections.abc import Mapping

import numpy as np

from .grib_sections import BrokenMessageError, number_at, sections


# A bitmap that stands in its section, and none, in edition 2.
_FOLLOWS, _NONE = 0, 255
# Packings of edition 2 whose values are counted here; codecs count for the others.
_SIMPLE, _COMPLEX, _DIFFERENCES, _IEEE, _JPEG, _PNG = 0, 2, 3, 4, 40, 41
_IEEE_BITS = {1: 32, 2: 64, 3: 128}
_WIDEST = 64
# Samples of a pixel by the colour type of PNG.
_SAMPLES = {0: 1, 2: 3, 6: 4}
# Of edition 1: flags of all but points one by one, as integers, without more flags.
_NOT_SIMPLE = 0xF0


def require_values(message: bytes, points: int) -> None:
    """Check that a message of one field holds as many values as it says.

    **Arguments:** `points`: of its grid.

    **Raises:** `BrokenMessageError` if it holds fewer, or something behind them.
    """
    content = {
        part.number: message[part.start : part.end]
        for part in sections(message, 0, len(message))
    }
    if message[7] == 2:
        _require_values_2(content, points)
    else:
        _require_values_1(content, points)


def _require_values_1(content: Mapping[int, bytes], points: int) -> None:
    bitmap, data = content.get(3), content[4]
    if bitmap and not number_at(bitmap, 4, 2):
        points = _marked(bitmap[6:], points)
    if not data[3] & _NOT_SIMPLE:
        _require_bits(data[11:], points * data[10])


def _require_values_2(content: Mapping[int, bytes], points: int) -> None:
    packing, bitmap, data = content[5], content[6], content[7][5:]
    if bitmap[5] == _FOLLOWS:
        points = _marked(bitmap[6:], points)
    if not points:
        # Some count one value where there is none.
        return
    values, template = number_at(packing, 5, 4), number_at(packing, 9, 2)
    if bitmap[5] in (_FOLLOWS, _NONE) and values != points:
        raise BrokenMessageError
    if template == _SIMPLE:
        _require_bits(data, values * packing[19])
    elif template == _IEEE:
        _require_bits(data, values * _IEEE_BITS.get(packing[11], 0))
    elif template in (_COMPLEX, _DIFFERENCES) and number_at(packing, 31, 4):
        _require_groups(packing, data, values, differences=template == _DIFFERENCES)
    elif template in (_JPEG, _PNG) and packing[19]:
        pixels = _pixels_of_jpeg if template == _JPEG else _pixels_of_png
        if pixels(data, packing[19]) != values:
            raise BrokenMessageError


def _pixels_of_jpeg(data: bytes, _bits: int) -> int:
    """Pixels of an image of one colour, as JPEG 2000 begins with them."""
    right, lower, left, upper = (number_at(data, at, 4) for at in (8, 12, 16, 20))
    return (right - left) * (lower - upper) if number_at(data, 40, 2) == 1 else 0


def _pixels_of_png(data: bytes, bits: int) -> int:
    """Pixels of an image whose pixels have so many bits at least."""
    width, height = (number_at(data, at, 4) for at in (16, 20))
    return width * height if data[24] * _SAMPLES.get(data[25], 0) >= bits else 0


def _require_groups(
    packing: bytes, data: bytes, values: int, *, differences: bool
) -> None:
    """Check complex packing: groups of values, each of a width and a length."""
    groups = number_at(packing, 31, 4)
    if groups > values:
        raise BrokenMessageError
    if differences:
        order, size = packing[47], packing[48]
        if order not in (1, 2) or size > _WIDEST // 8:
            raise BrokenMessageError
        data = data[(order + 1) * size :]
    for bits in (packing[19], packing[36], packing[46]):
        if bits > _WIDEST or groups * bits > 8 * len(data):
            raise BrokenMessageError
    data = data[_bytes(groups * packing[19]) :]
    width = packing[35] + _integers(data, groups, packing[36])
    data = data[_bytes(groups * packing[36]) :]
    length = number_at(packing, 37, 4) + packing[41] * _integers(
        data, groups, packing[46]
    )
    length[-1] = number_at(packing, 42, 4)
    if width.max() > _WIDEST or length.min() < 0 or length.sum() != values:
        raise BrokenMessageError
    data = data[_bytes(groups * packing[46]) :]
    _require_bits(data, int(np.sum(width * length)))


def _require_bits(data: bytes, bits: int) -> None:
    """Check that data end with so many bits, but for padding."""
    if bits > 8 * len(data) or data[_bytes(bits) :].strip(b"\0"):
        raise BrokenMessageError


def _marked(bitmap: bytes, points: int) -> int:
    """Points that have a value."""
    if 8 * len(bitmap) < points:
        raise BrokenMessageError
    return int(np.unpackbits(np.frombuffer(bitmap, np.uint8), count=points).sum())


def _integers(data: bytes, count: int, bits: int) -> np.ndarray:
    """Unsigned integers of so many bits each."""
    held = np.frombuffer(data[: _bytes(count * bits)], np.uint8)
    if 8 * held.size < count * bits:
        raise BrokenMessageError
    each = np.unpackbits(held, count=count * bits).reshape(count, bits)
    return each.astype(np.int64) @ (1 << np.arange(bits, dtype=np.int64)[::-1])


def _bytes(bits: int) -> int:
    return -(-bits // 8)
