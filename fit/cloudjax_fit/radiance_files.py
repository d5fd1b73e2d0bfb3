"""Radiances are read from whatever holds them: folders, files of ABI, own files."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cloudjax import Band, FixedGrid
from cloudjax_scenes.quantity import RADIANCE, parse_variable

from .band_radiances import BandRadiances


if TYPE_CHECKING:
    import xarray as xr

    from cloudjax_data import AbiBand


_MULTIBAND = re.compile(r"CMI_C(\d\d)$")
# What files that cloudjax wrote call their time: renders, and `to_dataset`.
_TIMES = ("time", "t")
# Further from a band's own wavelength a file speaks of another one.
_WAVELENGTH_TOLERANCE = 0.015


def read_radiances(path: str | PathLike[str]) -> dict[int, BandRadiances]:
    """Return every band that a path holds, keyed by band number.

    `path` is a scene folder, one ABI file, or a netCDF file that cloudjax wrote: one
    variable `radiance_C13` per band, with the attributes `units` and `abi_band`. Where
    a band has none, `reflectance_C01` or `brightness_temperature_C13` is read.

    Raises `cloudjax_data.DataError`, one sentence that names the file and the remedy,
    for anything else.
    """
    from cloudjax_data import DataError

    path = Path(path)
    if path.is_dir():
        return _read_folder(path)
    if not path.exists():
        raise DataError(f"{path} does not exist: give a scene folder or a netCDF file.")
    return _read_file(path)


def chosen(
    bands: Mapping[int, BandRadiances],
    numbers: Sequence[int] | None,
    path: str | PathLike[str],
) -> dict[int, BandRadiances]:
    """Return the bands of these numbers, by default all.

    **Raises:** `DataError` for a number that `path`, of which they are, does not hold.
    """
    from cloudjax_data import DataError

    missing = sorted(set(numbers or ()) - bands.keys())
    if missing:
        raise DataError(
            f"{path} does not hold band {', '.join(map(str, missing))}: it holds "
            f"{', '.join(map(str, sorted(bands)))}, ask for others."
        )
    return {number: bands[number] for number in numbers or bands}


def _read_folder(path: Path) -> dict[int, BandRadiances]:
    from cloudjax_data import open_folder

    return _of_abi(open_folder(path).read().bands.values())


def _of_abi(bands: "Iterable[AbiBand]") -> dict[int, BandRadiances]:
    from cloudjax_scenes.abi_bands import band_of_file

    return {
        b.number: BandRadiances(
            b.number,
            b.units,
            b.radiance,
            grid=b.grid,
            time=b.time,
            band=band_of_file(b),
        )
        for b in bands
    }


def _read_file(path: Path) -> dict[int, BandRadiances]:
    from cloudjax_data import DataError, read_band

    with _open_dataset(path) as dataset:
        names = {str(name) for name in dataset.data_vars}
        if any(map(parse_variable, names)):
            return _simulated_bands(dataset, path)
    if {"Rad", "CMI"} & names:
        return _of_abi([read_band(path)])
    numbers = sorted(int(m[1]) for name in names if (m := _MULTIBAND.match(name)))
    if not numbers:
        raise DataError(
            f"{path} holds neither ABI radiances nor those of a cloudjax run: "
            "give a scene folder, an ABI L1b or CMI file, or a simulated.nc."
        )
    return _of_abi(read_band(path, band=number) for number in numbers)


@contextmanager
def _open_dataset(path: Path) -> "Iterator[xr.Dataset]":
    import xarray as xr

    from cloudjax_data import DataError
    from cloudjax_data.plain_path import plain_path

    try:
        # Not decoded yet: the packed integers of ABI files are for their own reader.
        with (
            plain_path(path) as plain,
            xr.open_dataset(plain, engine="netcdf4", decode_cf=False) as dataset,
        ):
            yield dataset
    # The netCDF library raises RuntimeError when the header is whole and the data not.
    except (OSError, RuntimeError) as error:
        raise DataError(
            f"{path} cannot be read as netCDF: it is incomplete or of another kind; "
            "fetch or write it again."
        ) from error


def _simulated_bands(dataset: "xr.Dataset", path: Path) -> dict[int, BandRadiances]:
    import xarray as xr

    held = {name: parse_variable(str(name)) for name in dataset.data_vars}
    known = {name: found for name, found in held.items() if found is not None}
    grid, time = _grid_of(dataset), _time_of(dataset)
    # Radiances last: they replace what else there is of a band.
    names = sorted(known, key=lambda name: known[name][0] is RADIANCE)
    bands = {}
    decoded = xr.decode_cf(dataset[names], decode_times=False)
    for name in names:
        quantity, number = known[name]
        variable = decoded[name]
        _check_attributes(variable, number, path)
        units = str(variable.attrs["units"])
        values = variable.to_numpy()
        fits = grid is not None and grid.shape == values.shape
        band = _band_of(dataset, variable, number)
        bands[number] = BandRadiances(
            number, units, values, quantity, grid if fits else None, time, band
        )
    return dict(sorted(bands.items()))


def _grid_of(dataset: "xr.Dataset") -> FixedGrid | None:
    """The fixed grid of a file that cloudjax wrote, None of another projection."""
    axes = [dataset.variables.get(name) for name in ("x", "y")]
    mapping = dataset.variables.get("goes_imager_projection")
    if mapping is None or any(a is None or a.attrs.get("units") != "rad" for a in axes):
        return None
    x, y = (np.asarray(axis, float) for axis in axes)
    longitude = mapping.attrs.get("longitude_of_projection_origin")
    if x.size == 0 or y.size == 0 or not isinstance(longitude, int | float):
        return None
    return FixedGrid(x, y, float(longitude))


def _time_of(dataset: "xr.Dataset") -> datetime | None:
    """The time of a file that cloudjax wrote, None where it has no single one."""
    import xarray as xr

    for name in _TIMES:
        stored = dataset.variables.get(name)
        if stored is None or stored.size != 1 or "units" not in stored.attrs:
            continue
        try:
            times = xr.decode_cf(
                xr.Dataset({"moment": ((), stored.to_numpy().item(), stored.attrs)})
            )
        except ValueError:
            continue
        found = times["moment"].to_numpy()
        if np.issubdtype(found.dtype, np.datetime64) and not np.isnat(found):
            seconds = found.astype("datetime64[us]").item()
            return seconds.replace(tzinfo=UTC)
    return None


def _band_of(dataset: "xr.Dataset", variable, number: int) -> Band | None:
    """The band of the satellite that a file names, None if its wavelength is another:
    the coefficients of a sensor's own bands are in no file.
    """
    from cloudjax_scenes.abi_bands import band_of_satellite

    band = band_of_satellite(str(dataset.attrs.get("platform_ID", "")), number)
    told = variable.attrs.get("wavelength_um", band.wavelength_um)
    same = abs(float(told) / band.wavelength_um - 1) <= _WAVELENGTH_TOLERANCE
    return band if same else None


def _check_attributes(variable: "xr.DataArray", number: int, path: Path) -> None:
    from cloudjax_data import DataError

    if "units" not in variable.attrs:
        raise DataError(
            f"{path} gives {variable.name} without units: "
            "add the attribute, or write the file with cloudjax."
        )
    if int(variable.attrs.get("abi_band", number)) != number:
        raise DataError(
            f"{path} calls {variable.name} band {variable.attrs['abi_band']}: "
            "correct its name or its attribute abi_band."
        )
    if variable.ndim not in (1, 2):
        raise DataError(
            f"{path} gives {variable.name} on {', '.join(map(str, variable.dims))}: "
            "select one image (y, x) of it."
        )
