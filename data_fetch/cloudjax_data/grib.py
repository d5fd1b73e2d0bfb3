"""One variable of a GRIB file at a time.

A GFS file opened whole fails on its many kinds of level, or loses variables without a
word; one variable filtered by level type and short name does neither.
"""

import os
from pathlib import Path

import xarray as xr

from .errors import DataError


# what a second time, step or ensemble member would add as a dimension
_ONE_ANALYSIS = ("time", "step", "valid_time", "number")


def read_grib_variable(path: Path, level_type: str, name: str) -> xr.DataArray | None:
    """A variable by its GRIB short name, loaded; None if the file has none.

    **Raises:** `DataError` if the file is absent, not GRIB, corrupt, or holds several
    times or ensemble members.
    """
    if not path.is_file():
        raise DataError(f"{path} is not a file: check the path.")
    try:
        dataset = xr.open_dataset(
            path,
            engine="cfgrib",
            decode_timedelta=True,
            backend_kwargs={
                "filter_by_keys": {"typeOfLevel": level_type, "shortName": name},
                "errors": "raise",
                # no index beside the data: folders may be read-only, files may move
                "indexpath": "",
                "read_keys": ["uvRelativeToGrid"],
            },
        )
        found = [dataset[key].load() for key in dataset.data_vars]
    except Exception as error:  # eccodes, cfgrib and xarray have no common ancestor
        raise DataError(
            f"{path} cannot be read as GRIB ({error}): it is truncated, corrupt or of "
            "several grids, download it again."
        ) from error
    if not found:
        return None
    return _single(path, name, found[0])


def require_grib(path: Path) -> None:
    """Raise `DataError` unless the file is a whole number of GRIB messages.

    Looks at both ends only: eccodes skips what it does not recognise, so that a file
    cut short would merely seem to hold fewer levels.
    """
    if not path.is_file():
        raise DataError(f"{path} is not a file: check the path.")
    with path.open("rb") as stream:
        start = stream.read(4)
        stream.seek(max(path.stat().st_size - 4, 0), os.SEEK_SET)
        end = stream.read(4)
    if start != b"GRIB":
        raise DataError(f"{path} is not a GRIB file: use a GFS or NAM analysis.")
    if end != b"7777":
        raise DataError(f"{path} is truncated: download it again.")


def _single(path: Path, name: str, field: xr.DataArray) -> xr.DataArray:
    many = [dim for dim in _ONE_ANALYSIS if dim in field.dims]
    if many:
        raise DataError(
            f"{path} holds {name!r} for several values of {', '.join(many)}: keep the "
            "messages of one."
        )
    return field
