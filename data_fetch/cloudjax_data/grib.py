"""GRIB files are read one variable at a time.

A GFS file opened whole fails on its many kinds of level, or loses variables without a
word; one variable filtered by level type and short name does neither.
"""

import os
from collections.abc import Collection
from pathlib import Path
from typing import Any

import xarray as xr

from .errors import DataError


# what a second time, step or ensemble member would add as a dimension
_ONE_ANALYSIS = ("time", "step", "valid_time", "number")


def read_grib(
    path: Path, wanted: Collection[tuple[str, str]]
) -> dict[tuple[str, str], xr.DataArray]:
    """Read the variables that the file has, by type of level and GRIB short name.

    **Raises:** `DataError` if the file is absent, not GRIB, corrupt, or holds a
    variable for several times or ensemble members.
    """
    _require_grib(path)
    try:
        messages = _messages(path, wanted)
        fields = {key: _field(messages[key]) for key in wanted if messages[key]}
    except Exception as error:  # eccodes, cfgrib and xarray have no common ancestor
        raise DataError(
            f"{path} cannot be read as GRIB ({error}): it is truncated, corrupt or of "
            "several grids, download it again."
        ) from error
    for (_, name), field in fields.items():
        many = [dim for dim in _ONE_ANALYSIS if dim in field.dims]
        if many:
            raise DataError(
                f"{path} holds {name!r} for several values of {', '.join(many)}: keep "
                "the messages of one."
            )
    return fields


def _messages(
    path: Path, wanted: Collection[tuple[str, str]]
) -> dict[tuple[str, str], dict[Any, Any]]:
    """Messages by variable, from one pass: opened by path, cfgrib makes a pass each."""
    # Not at the top: eccodes takes seconds to load, and brings a PROJ of its own that
    # crashes a pyproj imported after it.
    from cfgrib.messages import FileStream

    found = {key: {} for key in wanted}
    for place, message in FileStream(str(path), errors="raise").items():
        key = message["typeOfLevel"], message["shortName"]
        if key in found:
            found[key][place] = message
    return found


def _field(messages: dict[Any, Any]) -> xr.DataArray:
    # Opened from messages, cfgrib leaves no index beside the data: folders may be
    # read-only, and files may move.
    dataset = xr.open_dataset(
        messages,  # pyright: ignore[reportArgumentType]
        engine="cfgrib",
        decode_timedelta=True,
        backend_kwargs={"errors": "raise", "read_keys": ["uvRelativeToGrid"]},
    )
    (name,) = dataset.data_vars
    return dataset[name].load()


def _require_grib(path: Path) -> None:
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
