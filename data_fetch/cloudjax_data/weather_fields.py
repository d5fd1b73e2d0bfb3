"""The fields of a file become one set of variables: on one grid, at one time."""

import itertools as it
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import numpy as np
import xarray as xr

from .errors import DataError
from .grib import PRESSURE, GribField, GribFields
from .lambert import LambertConic
from .weather_sky import MEANS, SKY, sky_of


# short name: units, as eccodes spells them
REQUIRED = {
    "u": "m s**-1",
    "v": "m s**-1",
    "w": "Pa s**-1",
    "r": "%",
    "t": "K",
    "gh": "gpm",
}
OPTIONAL = {"clwmr": "kg kg**-1", "icmr": "kg kg**-1", "tcc": "%"}
# name in the cube: type of level and short name in the file
GROUND = {
    "orog": ("surface", "orog"),
    "lsm": ("surface", "lsm"),
    "t_surface": ("surface", "t"),
    "t_2m": ("heightAboveGround", "2t"),
}
# Where no wind blows and no sun shines: these may be of another time.
_CONSTANT = ("orog", "lsm")
# Vertical velocity in m/s, to say that it is the wrong one.
_WRONG_W = "wz"

WANTED = (
    *((PRESSURE, name) for name in (*REQUIRED, *OPTIONAL, _WRONG_W)),
    *GROUND.values(),
    *sorted(MEANS),
)
# Variables that have no levels.
LEVELLESS = (*GROUND, *SKY)

# Far beyond any weather: what lies outside is a number that stands for "missing".
_POSSIBLE = {
    "u": (-300.0, 300.0),
    "v": (-300.0, 300.0),
    "w": (-200.0, 200.0),
    "r": (-50.0, 250.0),
    "t": (0.0, 500.0),
    "gh": (-5e3, 100e3),
    "clwmr": (-0.1, 1.0),
    "icmr": (-0.1, 1.0),
    "tcc": (-1.0, 101.0),
    "t_surface": (0.0, 500.0),
    "t_2m": (0.0, 500.0),
    "lsm": (-0.01, 1.01),
    "orog": (-1e3, 10e3),
}


@dataclass(frozen=True, eq=False)
class WeatherFields:
    """`WeatherFields` are the variables of a file, as the file has its grid.

    **Fields:**

    - `data`: on `(level, latitude, longitude)` or `(level, y, x)`, rows from the south.
    - `valid_time`: of all but land and height of the ground.
    - `lost_levels_hpa`: as in `WeatherCube`.
    - `projection`: the Lambert map, None on latitude and longitude.
    - `winds_along_grid`: whether winds are along the axes of the grid.
    - `means`: variables that are means over the hours before.
    """

    data: xr.Dataset
    valid_time: datetime
    lost_levels_hpa: Mapping[str, tuple[float, ...]]
    projection: LambertConic | None
    winds_along_grid: bool
    means: frozenset[str] = frozenset()


def assembled(path: Path, found: GribFields) -> WeatherFields:
    """Put the fields of a file together.

    **Raises:** `DataError` if one is missing, in other units, impossible, given twice
    with different values, or if fields are of several times, members or grids.
    """
    _require_all(path, found)
    by_name = {
        name: [f for f in found.fields if (f.level_type, f.name) == (PRESSURE, name)]
        for name in (*REQUIRED, *OPTIONAL)
    }
    ground = {
        name: [f for f in found.fields if (f.level_type, f.name) == kind]
        for name, kind in GROUND.items()
    }
    variables = {name: one for name, one in (by_name | ground).items() if one}
    for name, fields in variables.items():
        _require_one_time(path, name, fields)
    first = by_name["u"][0]
    _require_together(path, first, variables)
    levels = {
        name: _on_levels(path, name, by_name[name])
        for name in (*REQUIRED, *OPTIONAL)
        if by_name[name]
    }
    data, lost = _aligned(path, levels, first)
    for name, fields in ground.items():
        if fields:
            (field,) = _distinct(path, name, fields).values()
            data[name] = (data["gh"].dims[1:], field.values, {"units": field.units})
    sky = sky_of(found.fields, first)
    for name, values in sky.values.items():
        data[name] = (data["gh"].dims[1:], values, {"units": sky.units[name]})
    _require_possible(path, data)
    _require_rising(path, data)
    return WeatherFields(
        data,
        first.valid_time,
        lost,
        first.grid.projection,
        _winds_along_grid(path, [*by_name["u"], *by_name["v"]]),
        sky.means,
    )


def _require_all(path: Path, found: GribFields) -> None:
    held = {field.name for field in found.fields if field.level_type == PRESSURE}
    missing = [name for name in REQUIRED if name not in held]
    others = [name for name in missing if (PRESSURE, name) in found.other_kinds]
    if others:
        raise DataError(
            f"{path} has {', '.join(map(repr, others))} only as averages over time, "
            "spreads, probabilities or errors: get the analysis or the forecast itself."
        )
    if missing == ["w"] and _WRONG_W in held:
        raise DataError(
            f"{path} has the vertical velocity in m/s ('wz') and not in Pa/s ('w'): "
            "get the pressure vertical velocity (VVEL) too."
        )
    if missing:
        raise DataError(
            f"{path} has no {', '.join(map(repr, missing))} on pressure levels: get a "
            f"file with {', '.join(REQUIRED)}."
        )


def _require_one_time(path: Path, name: str, fields: Sequence[GribField]) -> None:
    seen = {
        "time": {field.start for field in fields},
        "step": {field.valid_time - field.start for field in fields},
        "number": {field.member for field in fields},
    }
    many = [what for what, values in seen.items() if len(values) > 1]
    if many:
        raise DataError(
            f"{path} holds {name!r} for several values of {', '.join(many)}: keep the "
            "messages of one."
        )


def _require_together(
    path: Path, first: GribField, variables: Mapping[str, Sequence[GribField]]
) -> None:
    """Raise `DataError` unless all are of the grid, time and member of one field."""
    for name, fields in variables.items():
        if not all(field.grid.is_same(first.grid) for field in fields):
            raise DataError(
                f"{path} has variables on different grids: keep the messages of one."
            )
        one = fields[0]
        if name in _CONSTANT:
            continue
        if (one.start, one.valid_time) != (first.start, first.valid_time):
            raise DataError(f"{path} holds several times: keep the messages of one.")
        if one.member != first.member:
            raise DataError(
                f"{path} holds several members of an ensemble: keep the messages of "
                "one."
            )


def _distinct(
    path: Path, name: str, fields: Sequence[GribField]
) -> dict[float, GribField]:
    """Fields by level; one that is there twice counts once."""
    found: dict[float, GribField] = {}
    for field in fields:
        # What is near the ground has one level.
        level = field.level if field.level_type == PRESSURE else 0.0
        known = found.setdefault(level, field)
        if known is not field and not np.array_equal(
            known.values, field.values, equal_nan=True
        ):
            where = f" at {level:g} hPa" if field.level_type == PRESSURE else ""
            raise DataError(
                f"{path} has {name!r}{where} twice, with different values: keep the "
                "right message of the two."
            )
    return found


def _on_levels(
    path: Path, name: str, fields: Sequence[GribField]
) -> dict[float, np.ndarray]:
    """Values by level, without levels that are masked everywhere."""
    units = (REQUIRED | OPTIONAL)[name]
    for field in fields:
        if field.units != units:
            raise DataError(
                f"{path} has {name!r} in {field.units!r} instead of {units!r}: get the "
                "file from the GFS or NAM."
            )
        if not field.level > 0:
            raise DataError(
                f"{path} has {name!r} at a pressure of {field.level:g} hPa: it is "
                "damaged, download it again."
            )
    known = {
        level: field.values
        for level, field in _distinct(path, name, fields).items()
        if np.isfinite(field.values).any()
    }
    if not known:
        raise DataError(f"{path} has {name!r} all masked: download it again.")
    return known


def _aligned(
    path: Path,
    fields: Mapping[str, Mapping[float, np.ndarray]],
    first: GribField,
) -> tuple[xr.Dataset, dict[str, tuple[float, ...]]]:
    """All variables on the levels that every required one has."""
    common = set.intersection(*(set(fields[name]) for name in REQUIRED))
    if len(common) < 2:
        raise DataError(
            f"{path} has fewer than two pressure levels on which all of "
            f"{', '.join(REQUIRED)} are given: get a file with more levels."
        )
    levels = sorted(common, reverse=True)
    grid, units = first.grid, REQUIRED | OPTIONAL
    plain = grid.projection is None
    rows = ("latitude", "longitude") if plain else ("y", "x")
    # an optional variable is NaN on a level of its own gap
    gap = np.full(grid.shape, np.nan, np.float32)
    variables = {
        name: (
            ("level", *rows),
            np.stack([values.get(level, gap) for level in levels]),
            {"units": units[name]},
        )
        for name, values in fields.items()
    }
    axes = {"latitude": grid.latitude_deg, "longitude": grid.longitude_deg}
    coordinates = {
        axis: ((axis,) if plain else rows, values, {"units": f"degrees_{end}"})
        for (axis, values), end in zip(axes.items(), ("north", "east"), strict=True)
    }
    described = {"units": "hPa", "positive": "down", "axis": "Z"}
    data = xr.Dataset(variables, {"level": ("level", levels, described), **coordinates})
    lost = {
        name: tuple(sorted(set(values) - common, reverse=True))
        for name, values in fields.items()
    }
    return data, lost


def _winds_along_grid(path: Path, winds: Sequence[GribField]) -> bool:
    along = {field.winds_along_grid for field in winds}
    if len(along) > 1 and winds[0].grid.projection is not None:
        raise DataError(
            f"{path} has some winds along its grid and some to the true north: get the "
            "file again."
        )
    return winds[0].winds_along_grid


def _require_possible(path: Path, data: xr.Dataset) -> None:
    for name, (low, high) in _POSSIBLE.items():
        if name not in data:
            continue
        values = data[name].to_numpy()
        wrong = values[(values < low) | (values > high)]
        if wrong.size:
            raise DataError(
                f"{path} has {name!r} of {wrong[0]:g} at {wrong.size} points: what is "
                "missing must be masked, download it again."
            )


def _require_rising(path: Path, data: xr.Dataset) -> None:
    """Raise `DataError` if a lower pressure is not higher up: levels are mixed up."""
    height, levels = data["gh"].to_numpy(), data["level"].to_numpy()
    for (low, below), (high, above) in it.pairwise(zip(levels, height, strict=True)):
        if np.any(above <= below):
            raise DataError(
                f"{path} has heights ('gh') that do not rise from {low:g} to {high:g} "
                "hPa: its levels are mixed up, get the file again."
            )
