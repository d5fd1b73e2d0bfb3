"""Compressed netCDF4 files through xarray."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import xarray as xr


def write_netcdf(path: Path, data: xr.Dataset | xr.DataTree) -> None:
    """Write all numbers compressed.

    **Raises:** `OSError` if the disk does not take them.
    """
    groups = data.subtree if isinstance(data, xr.DataTree) else [data]
    for group in groups:
        for variable in group.variables.values():
            if variable.ndim and variable.dtype.kind in "fiu":
                variable.encoding |= {"zlib": True, "complevel": 9, "shuffle": True}
    with disk_errors():
        data.to_netcdf(path, engine="netcdf4", format="NETCDF4")


@contextmanager
def disk_errors() -> Iterator[None]:
    """Raise `OSError` for `RuntimeError`, the netCDF library's word for a full disk."""
    try:
        yield
    except RuntimeError as error:
        raise OSError(str(error)) from error
