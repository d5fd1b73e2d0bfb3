"""Packed netCDF variables are decoded by hand.

ABI files store unsigned counts in signed integers and say so in an attribute
(PUG volume 3, section 5.0.2). Generic decoders have compared the fill value before
the cast, or widened through float32; here the cast comes first, the fill test is made
on integers, and each caller chooses the precision of scale and offset.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from types import EllipsisType
from typing import Any, cast

import netCDF4
import numpy as np

from .errors import DataError


@contextmanager
def netcdf_file(path: str | PathLike[str]) -> Iterator[netCDF4.Dataset]:
    """Open a netCDF file with all automatic decoding off.

    Raises `DataError` when the file is absent, or when it or a variable read inside
    the `with` block is truncated or corrupt: HDF5 reports that as late as the read.
    """
    path = Path(path)
    if not path.is_file():
        raise DataError(f"{path} is not a file: check the path.")
    try:
        with netCDF4.Dataset(path) as file:
            file.set_auto_maskandscale(False)
            yield file
    except (OSError, RuntimeError) as error:
        raise DataError(
            f"{path} cannot be read as netCDF ({error}): it is truncated or corrupt, "
            "download it again."
        ) from error


def variable(file: netCDF4.Dataset, name: str) -> netCDF4.Variable:
    """Return the variable of that name, or raise `DataError`."""
    if name not in file.variables:
        raise DataError(
            f"{file.filepath()} has no variable {name!r}: it is not an ABI product "
            "this reader knows, use ABI L1b radiances or CMI files."
        )
    return cast(netCDF4.Variable, file.variables[name])


def attribute(owner: netCDF4.Dataset | netCDF4.Variable, name: str) -> Any:
    """Return the attribute of that name of a file or of a variable, or raise
    `DataError`.
    """
    if name in owner.ncattrs():
        return owner.getncattr(name)
    is_file = isinstance(owner, netCDF4.Dataset)
    path = owner.filepath() if is_file else owner.group().filepath()
    of = "global" if is_file else f"{owner.name!r}"
    raise DataError(
        f"{path} lacks the {of} attribute {name!r}: it is not a complete ABI file, "
        "download it again."
    )


def scalar(file: netCDF4.Dataset, name: str) -> float | None:
    """Return a number of the file, or None where it is absent or its fill value."""
    if name not in file.variables:
        return None
    value = np.asarray(file.variables[name][...]).reshape(-1)[0]
    fill = getattr(file.variables[name], "_FillValue", None)
    return None if value == fill or not np.isfinite(value) else float(value)


def counts(
    packed: netCDF4.Variable, where: tuple[slice, ...] | EllipsisType = ...
) -> tuple[np.ndarray, np.ndarray]:
    """Return the stored integers, unsigned where the file says so, and where they are
    valid.

    **Arguments:**

    - `where`: the part of the variable to read, by default all of it.

    **Returns:** the counts, and a boolean array of the same shape that is False where
    a count equals the fill value.
    """
    stored = np.asarray(packed[where])
    fill = getattr(packed, "_FillValue", None)
    if str(getattr(packed, "_Unsigned", "false")).lower() == "true":
        stored = _unsigned(stored)
        fill = None if fill is None else _unsigned(np.asarray(fill))
    valid = np.ones(stored.shape, bool) if fill is None else stored != fill
    return stored, valid


def scale_and_offset(packed: netCDF4.Variable) -> tuple[float, float]:
    """Return scale and offset of a packed variable: value = count * scale + offset."""
    return (
        float(getattr(packed, "scale_factor", 1.0)),
        float(getattr(packed, "add_offset", 0.0)),
    )


def _unsigned(stored: np.ndarray) -> np.ndarray:
    return stored.astype(f"u{stored.dtype.itemsize}")
