"""Compressed netCDF4 files through xarray."""

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
    try:
        data.to_netcdf(path, engine="netcdf4", format="NETCDF4")
    # The netCDF library's word for a full disk.
    except RuntimeError as error:
        raise OSError(str(error)) from error
