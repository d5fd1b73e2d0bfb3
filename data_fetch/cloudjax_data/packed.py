"""Packed netCDF variables are decoded by hand.

ABI files store unsigned counts in signed integers and say so in an attribute
(PUG volume 3, section 5.0.2). Generic decoders have compared the fill value before
the cast, or widened through float32; here the cast comes first, the fill test is made
on integers, and each caller chooses the precision of scale and offset.

Whatever legal encoding other tools have given the same values reads alike: floats,
other integers, other fill values, either order of bytes.
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
from .plain_path import plain_path


# The dialect of ABI for "does not apply".
ABSENT = -999.0


@contextmanager
def netcdf_file(path: str | PathLike[str]) -> Iterator[netCDF4.Dataset]:
    """Open a netCDF file with all automatic decoding off.

    Raises `DataError` when the file is absent, or when it or a variable read inside
    the `with` block is truncated or corrupt: HDF5 reports that as late as the read.
    """
    path = Path(path)
    if not path.is_file():
        raise DataError(f"{path} is not a file: check the path.")
    with plain_path(path) as plain:
        try:
            with netCDF4.Dataset(plain) as file:
                file.set_auto_maskandscale(False)
                yield file
        except (OSError, RuntimeError) as error:
            reason = str(error).replace(str(plain), str(path))
            raise DataError(
                f"{path} cannot be read as netCDF ({reason}): it is truncated, corrupt "
                "or of another kind, download it again."
            ) from error
        except DataError as error:
            if plain == path:
                raise
            raise DataError(str(error).replace(str(plain), str(path))) from error


def variable(file: netCDF4.Dataset, name: str) -> netCDF4.Variable:
    """Return the variable of that name, which holds numbers, or raise `DataError`."""
    if name not in file.variables:
        raise DataError(
            f"{file.filepath()} has no variable {name!r}: it is not an ABI product "
            "this reader knows, use ABI L1b radiances or CMI files."
        )
    found = cast(netCDF4.Variable, file.variables[name])
    if not _is_numeric(found):
        raise DataError(
            f"{file.filepath()} holds no numbers in {name!r}: it is not a file of ABI "
            "as NOAA writes it, download it again."
        )
    return found


def attribute(owner: netCDF4.Dataset | netCDF4.Variable, name: str) -> Any:
    """Return the attribute of that name of a file or of a variable, or raise
    `DataError`.
    """
    if name in owner.ncattrs():
        return owner.getncattr(name)
    path, of = _called(owner)
    raise DataError(
        f"{path} lacks the {of} attribute {name!r}: it is not a complete ABI file, "
        "download it again."
    )


def number_attribute(
    owner: netCDF4.Dataset | netCDF4.Variable, name: str, default: float | None = None
) -> float:
    """Return an attribute that is one finite number; without it the default, if any.

    Raises `DataError` for anything else.
    """
    if default is not None and name not in owner.ncattrs():
        return default
    given = attribute(owner, name)
    value = np.asarray(given)
    if value.dtype.kind in "iuf" and value.size == 1 and np.isfinite(value).all():
        return float(value.reshape(-1)[0])
    path, of = _called(owner)
    raise DataError(
        f"{path} gives the {of} attribute {name!r} as {given!r}, which is no number: "
        "download it again."
    )


def scalar(file: netCDF4.Dataset, name: str) -> float | None:
    """Return a number of the file, or None where it is absent or its fill value."""
    if name not in file.variables:
        return None
    stored, valid = counts(variable(file, name))
    if stored.size == 0 or not valid.reshape(-1)[0]:
        return None
    value = float(stored.reshape(-1)[0])
    return None if value == ABSENT else value


def counts(
    packed: netCDF4.Variable, where: tuple[slice | int, ...] | EllipsisType = ...
) -> tuple[np.ndarray, np.ndarray]:
    """Return the stored numbers, unsigned where the file says so, and where they are
    valid.

    **Arguments:**

    - `where`: the part of the variable to read, by default all of it.

    **Returns:** the numbers, in the byte order of the machine, and a boolean array of
    the same shape that is False where one is not finite, equals a fill value or lies
    out of the valid range.
    """
    stored = np.asarray(packed[where])
    stored = stored.astype(stored.dtype.newbyteorder("="), copy=False)
    unsigned = _is_unsigned(packed)
    if unsigned:
        stored = _unsigned(stored)
    valid = np.asarray(np.isfinite(stored))
    for fill in _fill_values(packed, unsigned):
        valid = valid & (stored != fill)
    low, high = _valid_range(packed, unsigned)
    if low is not None:
        valid = valid & (stored >= low)
    if high is not None:
        valid = valid & (stored <= high)
    return stored, np.asarray(valid)


def scale_and_offset(
    packed: netCDF4.Variable, *, from_zero: bool = False
) -> tuple[float, float]:
    """Return scale and offset of a packed variable: value = count * scale + offset.

    **Arguments:** `from_zero`: whether there need be no offset.

    Raises `DataError` for those that are no numbers, and for whole numbers of which one
    of the two is lost.
    """
    held = [name in packed.ncattrs() for name in ("scale_factor", "add_offset")]
    if packed.dtype.kind != "f" and (held[1] or not from_zero) and not all(held):
        path, of = _called(packed)
        raise DataError(
            f"{path} packs {of} without a scale or without an offset, so that its "
            "counts mean nothing: download it again."
        )
    return (
        number_attribute(packed, "scale_factor", 1.0),
        number_attribute(packed, "add_offset", 0.0),
    )


def _is_numeric(found: netCDF4.Variable) -> bool:
    return isinstance(found.dtype, np.dtype) and found.dtype.kind in "iuf"


def _called(owner: netCDF4.Dataset | netCDF4.Variable) -> tuple[str, str]:
    """The path of the file, and what to call its part."""
    if isinstance(owner, netCDF4.Dataset):
        return owner.filepath(), "global"
    return owner.group().filepath(), repr(owner.name)


def _is_unsigned(packed: netCDF4.Variable) -> bool:
    if packed.dtype.kind != "i":
        return False
    said = getattr(packed, "_Unsigned", None)
    if said is not None:
        word = str(said).strip().lower()
        if word in ("true", "false"):
            return word == "true"
        path, of = _called(packed)
        raise DataError(
            f"{path} says {said!r} of whether {of} is unsigned, and not true or false: "
            "download it again."
        )
    # Of signed numbers, a range would not end before it begins.
    low, high = _stated_range(packed)
    return low is not None and high is not None and bool(low > high)


def _unsigned(stored: np.ndarray) -> np.ndarray:
    if stored.dtype.kind != "i":
        return stored
    return stored.astype(f"u{stored.dtype.itemsize}")


def _fill_values(packed: netCDF4.Variable, unsigned: bool) -> list[Any]:
    given = [
        value
        for name in ("_FillValue", "missing_value")
        for value in np.atleast_1d(np.asarray(getattr(packed, name, ())))
        if value.dtype.kind in "iuf"
    ]
    if not given and packed.dtype.itemsize > 1 and not unsigned:
        # What the netCDF library leaves where nothing has been written.
        usual = netCDF4.default_fillvals[packed.dtype.str[1:]]
        given = [np.asarray(usual, packed.dtype)[()]]
    return [_unsigned(np.asarray(v))[()] if unsigned else v for v in given]


def _stated_range(packed: netCDF4.Variable):
    """The lowest and the highest valid number, each None where the file is silent.

    Of another type than the variable it is that of the unpacked values, or left over
    from another encoding.
    """
    both = np.asarray(getattr(packed, "valid_range", ()))
    if both.size == 2 and both.dtype.newbyteorder("=") == packed.dtype.newbyteorder(
        "="
    ):
        return both[0], both[1]
    ends = (np.asarray(getattr(packed, f"valid_{end}", ())) for end in ("min", "max"))
    low, high = (
        end.reshape(-1)[0]
        if end.size == 1
        and end.dtype.newbyteorder("=") == packed.dtype.newbyteorder("=")
        else None
        for end in ends
    )
    return low, high


def _valid_range(packed: netCDF4.Variable, unsigned: bool):
    if packed.dtype.kind == "f":
        # Decoders that write floats keep the range of the counts.
        return None, None
    low, high = _stated_range(packed)
    if not unsigned:
        return low, high
    return tuple(
        None if end is None else _unsigned(np.asarray(end)) for end in (low, high)
    )
