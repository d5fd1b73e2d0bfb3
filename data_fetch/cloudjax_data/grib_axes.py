"""Latitudes and longitudes of a GRIB grid, from first point, last point and increment.

Each of the three is rounded, to a thousandth of a degree in edition 1; last points are
written in many ways, and increments may be missing. What fits together is used at its
most accurate, and what does not is refused.
"""

from pathlib import Path

import numpy as np
from jaxtyping import Float64

from .errors import DataError


# Of a step: numbers that agree so far are the same but for rounding.
_SAME = 1e-2
# Increments and ends are rounded to this [degrees], in edition 1 and what came from it.
_ROUNDED_DEG = 0.6e-3


def latitudes(
    path: Path,
    first: float,
    last: float,
    increment: float | None,
    count: int,
    *,
    northward: bool,
) -> Float64[np.ndarray, " rows"]:
    """Return the latitudes of the rows, ascending.

    **Arguments:** `northward`: whether rows are scanned from the south.

    **Raises:** `DataError` if the numbers contradict each other or leave the Earth.
    """
    span = last - first if northward else first - last
    step = _step(span, increment, count)
    south = first if northward else first - (count - 1) * (step or 0.0)
    axis = south + (step or 0.0) * np.arange(count)
    if step is None or not np.abs(axis).max() < 90 + _SAME * step:
        raise DataError(
            _contradiction(path, "latitude", first, last, increment, count, northward)
        )
    return np.clip(axis, -90, 90)


def longitudes(
    path: Path,
    first: float,
    last: float,
    increment: float | None,
    count: int,
    *,
    westward: bool,
) -> Float64[np.ndarray, " columns"]:
    """Return the longitudes of the columns, ascending from the westernmost one.

    **Arguments:** `westward`: whether columns are scanned from the east.

    **Raises:** `DataError` if the numbers contradict each other.
    """
    span = (first - last if westward else last - first) % 360
    if span < _SAME * 360 / count or span > 360 - _SAME * 360 / count:
        # The first meridian again, at the end of the circle.
        span = 360.0
    step = _step(span, increment, count)
    # The end of the circle may be meant where the last point should be.
    if step is None and span == 360.0 and increment is not None:
        step = 360 / count if _is_same(count * increment, 360.0, increment) else None
    if step is None or (count - 1) * step > 360 + _SAME * step:
        raise DataError(
            _contradiction(
                path, "longitude", first, last, increment, count, not westward
            )
        )
    if _is_same(count * step, 360.0, step):
        step = 360 / count
    west = first - (count - 1) * step if westward else first
    return west + step * np.arange(count)


def _step(span: float, increment: float | None, count: int) -> float | None:
    """The step by first and last point, None if it is not that of the increment."""
    step = span / (count - 1)
    if not step > 0:
        return None
    if increment is None:
        return step
    excess = span - (count - 1) * increment
    if abs(excess) < min(_SAME * increment, (count + 1) * _ROUNDED_DEG):
        return step
    # Last points that are a whole number of steps away are wrong, and not rounded.
    steps = excess / increment
    whole = abs(steps - round(steps)) < _SAME
    return step if abs(step - increment) < _ROUNDED_DEG and not whole else None


def _is_same(one: float, other: float, step: float) -> bool:
    return abs(one - other) < _SAME * step


def _contradiction(
    path: Path,
    axis: str,
    first: float,
    last: float,
    increment: float | None,
    count: int,
    ascending: bool,
) -> str:
    ways = {
        ("latitude", True): "northward",
        ("latitude", False): "southward",
        ("longitude", True): "eastward",
        ("longitude", False): "westward",
    }
    step = "" if increment is None else f" in steps of {increment:g}"
    return (
        f"{path} contradicts itself: {count} {axis}s from {first:g} to {last:g} degrees"
        f"{step}, {ways[axis, ascending]}, do not exist, download it again."
    )
