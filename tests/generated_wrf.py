"""Small wrfout files of any map, with what the tests of columns need."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import netCDF4
import numpy as np


ROWS, COLUMNS, LEVELS = 6, 7, 5
TIMES = ("2005-08-28_12:00:00",)


def write_wrf(
    path: Path,
    latitude: np.ndarray | None = None,
    longitude: np.ndarray | None = None,
    attributes: Mapping[str, object] | None = None,
    *,
    times: Sequence[str] = TIMES,
    without: Sequence[str] = (),
    ground_m: np.ndarray | float = 0.0,
    **changed: np.ndarray,
) -> Path:
    """Write columns 1 km deep per level over ground, with cloud in the second level.

    **Arguments:**

    - `latitude`, `longitude`: of the columns; by default those of an ideal run.
    - `without`: variables to leave out.
    - `changed`: variables of one time, in place of what they would be.
    """
    shape = (ROWS, COLUMNS) if latitude is None else latitude.shape
    fields = _fields(shape, np.broadcast_to(ground_m, shape)) | {
        "XLAT": np.zeros(shape) if latitude is None else latitude,
        "XLONG": np.zeros(shape) if longitude is None else longitude,
    }
    fields |= changed
    with netCDF4.Dataset(path, "w") as file:
        file.setncatts(
            {"DX": 3000.0, "DY": 3000.0, "MAP_PROJ": 0, **(attributes or {})}
        )
        _dimensions(file, shape, next(iter(fields.values())).shape[0])
        stamps = file.createVariable("Times", "S1", ("Time", "DateStrLen"))
        stamps[:] = np.array([list(t) for t in times], "S1")
        for name, values in fields.items():
            if name not in without:
                variable = file.createVariable(name, "f4", _axes(name))
                for i in range(len(times)):
                    variable[i] = values
        if "Times" in without:
            file.renameVariable("Times", "Stamps")
    return path


def _dimensions(file: netCDF4.Dataset, shape, levels: int) -> None:
    rows, columns = shape
    for name, size in {
        "south_north": rows,
        "west_east": columns,
        "bottom_top": levels,
    }.items():
        file.createDimension(name, size)
        file.createDimension(f"{name}_stag", size + 1)
    file.createDimension("Time", None)
    file.createDimension("DateStrLen", 19)


_STAGGERED = {
    "PH": "bottom_top",
    "PHB": "bottom_top",
    "W": "bottom_top",
    "U": "west_east",
    "V": "south_north",
}


def _axes(name: str) -> tuple[str, ...]:
    if name == "XTIME":
        return ("Time",)
    level = ("south_north", "west_east")
    axes = level if name in ("XLAT", "XLONG", "HGT") else ("bottom_top", *level)
    of = _STAGGERED.get(name)
    return ("Time", *(f"{axis}_stag" if axis == of else axis for axis in axes))


def _fields(shape, ground) -> dict[str, np.ndarray]:
    levels = np.ones((LEVELS, *shape))
    ends = np.arange(LEVELS + 1.0)[:, None, None] * 1000 + ground
    middle = (ends[1:] + ends[:-1]) / 2
    rows, columns = shape
    cloud = 0 * levels
    cloud[1] = 1e-4 * (1 + np.arange(rows)[:, None] + 10 * np.arange(columns))
    return {
        "P": 0 * levels,
        "PB": 1e5 * np.exp(-middle / 8000),
        "PH": 9.81 * ends * 0.01,
        "PHB": 9.81 * ends * 0.99,
        "T": 0 * levels,
        "QVAPOR": 0.01 * levels,
        "QCLOUD": cloud,
        "HGT": np.array(ground, float),
        "U": np.ones((LEVELS, rows, columns + 1)) * 10,
        "V": np.ones((LEVELS, rows + 1, columns)) * 5,
        "W": np.ones((LEVELS + 1, rows, columns)),
    }
