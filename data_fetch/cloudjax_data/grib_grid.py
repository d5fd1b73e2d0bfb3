"""The grid of a GRIB message, from its first point, its increments and its scan.

The points of a field come in one of sixteen orders: columns from the west or the east,
rows from the north or the south, row by row or column by column, and every line in the
same direction or every other one backwards. Here all are brought to rows from the south
and columns from the west.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Shaped

from .errors import DataError
from .grib_axes import latitudes, longitudes
from .lambert import LambertConic


# Radius [m] by the number that GRIB 2 has for it (code table 3.2); GRIB 1 has 0.
_SPHERES = {0: 6367470.0, 6: 6371229.0, 8: 6371200.0}
_OWN_SPHERE = 1
# Grids whose numbers differ by less than this share of a cell are one grid.
_SAME = 1e-2
# Beyond all degrees and metres: eccodes has 1e100 where a number is missing.
_LARGEST = 1e9

Get = Callable[[str], Any]


@dataclass(frozen=True)
class Scan:
    """A `Scan` is the order of the points of a field.

    **Fields:** whether `columns_from_east`, `rows_from_south`, `column_by_column`, and
    `alternating`, every other line backwards.
    """

    columns_from_east: bool
    rows_from_south: bool
    column_by_column: bool
    alternating: bool

    def arranged(
        self, values: Shaped[np.ndarray, " points"], rows: int, columns: int
    ) -> Shaped[np.ndarray, "rows columns"]:
        """Return values with rows from the south and columns from the west."""
        lines = (columns, rows) if self.column_by_column else (rows, columns)
        field = values.reshape(lines)
        if self.alternating:
            field = field.copy()
            field[1::2] = field[1::2, ::-1]
        if self.column_by_column:
            field = field.T
        if self.columns_from_east:
            field = field[:, ::-1]
        return field if self.rows_from_south else field[::-1]


@dataclass(frozen=True, eq=False)
class GribGrid:
    """A `GribGrid` has the places of a field, rows from the south, columns from the
    west.

    **Fields:**

    - `scan`: the order of its points in the message.
    - `latitude_deg`, `longitude_deg`: of rows and of columns, or on a Lambert map both
        `[row, column]`; longitudes ascend from that of the first column.
    - `projection`: the Lambert map, None on latitude and longitude.
    """

    scan: Scan
    latitude_deg: Float[np.ndarray, "*rows"]
    longitude_deg: Float[np.ndarray, "*columns"]
    projection: LambertConic | None = None

    @property
    def shape(self) -> tuple[int, int]:
        """Count rows and columns."""
        return self.latitude_deg.shape[0], self.longitude_deg.shape[-1]

    def is_same(self, other: "GribGrid") -> bool:
        """Tell whether both have the same places, whatever the order of points."""
        if self is other:
            return True
        if self.shape != other.shape or self.projection != other.projection:
            return False
        cell = _SAME * abs(np.diff(self.latitude_deg[:2], axis=0).flat[0])
        return bool(
            np.allclose(self.latitude_deg, other.latitude_deg, rtol=0, atol=cell)
            and np.allclose(
                (self.longitude_deg - other.longitude_deg + 180) % 360,
                180,
                rtol=0,
                atol=cell,
            )
        )


def grid_of(path: Path, get: Get) -> GribGrid:
    """Read the grid of a message.

    **Arguments:** `get`: gives the value of a key of eccodes, None for a missing one.

    **Raises:** `DataError` if it is neither latitude-longitude nor Lambert, has fewer
    than two rows or columns, or its numbers contradict each other.
    """
    kind = get("gridType")
    if kind not in ("regular_ll", "lambert"):
        raise DataError(
            f"{path} is on a {kind!r} grid: get it on a latitude-longitude or a "
            "Lambert grid."
        )
    scan = _scan(path, get)
    columns, rows = (get(key) or 0 for key in ("Nx", "Ny"))
    if min(rows, columns) < 2:
        raise DataError(
            f"{path} has a single latitude or longitude: get a wider region."
        )
    if rows * columns != get("numberOfDataPoints"):
        raise DataError(
            f"{path} has a field of {get('numberOfDataPoints')} points on a grid of "
            f"{rows} by {columns}: download it again."
        )
    if kind == "lambert":
        return _lambert(path, get, scan, rows, columns)
    latitude = latitudes(
        path,
        _number(path, get, "latitudeOfFirstGridPointInDegrees"),
        _number(path, get, "latitudeOfLastGridPointInDegrees"),
        _increment(get, "j"),
        rows,
        northward=scan.rows_from_south,
    )
    longitude = longitudes(
        path,
        _number(path, get, "longitudeOfFirstGridPointInDegrees"),
        _number(path, get, "longitudeOfLastGridPointInDegrees"),
        _increment(get, "i"),
        columns,
        westward=scan.columns_from_east,
    )
    return GribGrid(scan, latitude, longitude)


def _scan(path: Path, get: Get) -> Scan:
    edition, flags = get("edition"), get("scanningMode")
    # The fourth flag is of edition 2; those after it shift points by half a cell.
    if flags & (0x1F if edition == 1 else 0x0F):
        raise DataError(
            f"{path} has points in an order that is not known (scanning flags "
            f"{flags:08b}): get it on a latitude-longitude grid."
        )
    return Scan(*(bool(flags & bit) for bit in (0x80, 0x40, 0x20, 0x10)))


def _number(path: Path, get: Get, key: str) -> float:
    value = get(key)
    if value is None or not abs(value) < _LARGEST:
        raise DataError(
            f"{path} has a grid without {key!r}: it is damaged, download it again."
        )
    return float(value)


def _increment(get: Get, axis: str) -> float | None:
    """The step in degrees, None where the message has none."""
    number = get(f"{axis}DirectionIncrement")
    if not number or not get(f"{axis}DirectionIncrementGiven"):
        return None
    return get(f"{axis}DirectionIncrementInDegrees")


def _lambert(path: Path, get: Get, scan: Scan, rows: int, columns: int) -> GribGrid:
    radius = _radius_m(path, get)
    projection = LambertConic(
        *(_number(path, get, f"{key}InDegrees") for key in ("LoV", "Latin1", "Latin2"))
    )
    one, two = projection.latitude_1_deg, projection.latitude_2_deg
    if not (0 < abs(one) < 90 and 0 < abs(two) < 90 and one * two > 0):
        raise DataError(
            f"{path} has a Lambert map whose cone meets the Earth at {one:g} and "
            f"{two:g} degrees: download it again."
        )
    first = [
        _number(path, get, f"{axis}OfFirstGridPointInDegrees")
        for axis in ("latitude", "longitude")
    ]
    step_m = [_number(path, get, f"D{axis}InMetres") for axis in "xy"]
    if not abs(first[0]) < 90 or not min(step_m) > 0:
        raise DataError(
            f"{path} has a Lambert map that starts at latitude {first[0]:g}, in steps "
            f"of {step_m[0]:g} and {step_m[1]:g} m: download it again."
        )
    x, y = projection.project(*np.array(first)[:, None])
    # The map's own unit of length.
    dx, dy = (step / (radius * projection.scale) for step in step_m)
    i, j = np.arange(columns), np.arange(rows)
    x = x + dx * (i - columns + 1 if scan.columns_from_east else i)
    y = y + dy * (j if scan.rows_from_south else j - rows + 1)
    latitude, longitude = projection.unproject(*np.meshgrid(x, y))
    return GribGrid(scan, latitude, longitude, projection)


def _radius_m(path: Path, get: Get) -> float:
    shape = get("shapeOfTheEarth") if get("edition") == 2 else 0
    radius = _SPHERES.get(shape)
    if shape == _OWN_SPHERE:
        radius = get("radius")
    if not radius or (get("edition") == 1 and get("earthIsOblate")):
        raise DataError(
            f"{path} is not on a spherical Earth: get it on a latitude-longitude grid."
        )
    return float(radius)
