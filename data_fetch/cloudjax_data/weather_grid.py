"""Grids of weather models are brought to one orientation."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from .errors import DataError
from .lambert import LambertConic


def oriented(
    path: Path, data: xr.Dataset, grib: Mapping[str, Any]
) -> tuple[xr.Dataset, LambertConic | None]:
    """Return data with latitudes ascending, longitudes continuous, winds relative to
    Earth.

    `grib` holds the attributes of cfgrib for the zonal wind. Raises `DataError` for
    grids other than latitude-longitude and Lambert.
    """
    kind = grib["GRIB_gridType"]
    if kind == "regular_ll":
        _require_meridians(path, data)
        return _on_ascending_axes(path, data), None
    if kind != "lambert":
        raise DataError(
            f"{path} is on a {kind!r} grid: get it on a latitude-longitude or a "
            "Lambert grid."
        )
    if grib["GRIB_iScansNegatively"] or not grib["GRIB_jScansPositively"]:
        raise DataError(
            f"{path} is not scanned from the south-west corner: get it from NOAA, "
            "whose Lambert grids are."
        )
    projection = LambertConic(
        *(float(grib[f"GRIB_{key}InDegrees"]) for key in ("LoV", "Latin1", "Latin2"))
    )
    longitude = projection.unwrapped(data["longitude"].to_numpy())
    data = data.assign_coords(longitude=(("y", "x"), longitude))
    if grib["GRIB_uvRelativeToGrid"]:
        data = rotated_to_earth(data, projection)
    return data, projection


def rotated_to_earth(data: xr.Dataset, projection: LambertConic) -> xr.Dataset:
    """Turn winds along the axes of the map to the true east and north."""
    angle = projection.rotation_rad(data["longitude"].to_numpy())
    sin, cos = np.sin(angle).astype(np.float32), np.cos(angle).astype(np.float32)
    u, v = data["u"], data["v"]
    east = u.copy(data=u.to_numpy() * cos + v.to_numpy() * sin)
    north = v.copy(data=v.to_numpy() * cos - u.to_numpy() * sin)
    return data.assign(u=east, v=north)


def on_plain_axes(
    path: Path, data: xr.Dataset, projection: LambertConic, step_deg: float
) -> xr.Dataset:
    """Return Lambert data at the multiples of a step in latitude and longitude."""
    # scipy takes longer to import than a file to read
    from scipy.interpolate import RegularGridInterpolator

    latitude = _multiples(data["latitude"].to_numpy(), step_deg)
    longitude = _multiples(data["longitude"].to_numpy(), step_deg)
    x, y = projection.project(*np.meshgrid(latitude, longitude, indexing="ij"))
    points = np.stack([y, x], axis=-1)
    axes = _map_axes(path, data, projection)

    def interpolated(values: xr.DataArray) -> xr.DataArray:
        table = values.transpose("y", "x", ...).to_numpy()
        found = RegularGridInterpolator(axes, table, bounds_error=False)(points)
        levels = [dim for dim in values.dims if dim == "level"]
        dims = ("latitude", "longitude", *levels)
        result = xr.DataArray(found.astype(table.dtype), dims=dims, attrs=values.attrs)
        return result.transpose(*levels, ...)

    fields = {name: interpolated(values) for name, values in data.data_vars.items()}
    coordinates = {
        "level": data["level"],
        "latitude": ("latitude", latitude, {"units": "degrees_north"}),
        "longitude": ("longitude", _from_zero(longitude), {"units": "degrees_east"}),
    }
    return xr.Dataset(fields, coords=coordinates, attrs=data.attrs)


def _map_axes(
    path: Path, data: xr.Dataset, projection: LambertConic
) -> tuple[np.ndarray, np.ndarray]:
    """The y and x of the rows and columns, on a map of the sphere."""
    x, y = projection.project(data["latitude"].to_numpy(), data["longitude"].to_numpy())
    # Latitudes of a model on an ellipsoid bend the rows on a map of the sphere.
    bend = max(np.ptp(x, axis=0).max(), np.ptp(y, axis=1).max())
    if bend > 0.05 * np.diff(x[0]).min():
        raise DataError(
            f"{path} is not on a spherical Earth: get it on a latitude-longitude grid."
        )
    return y.mean(axis=1), x.mean(axis=0)


def _multiples(values: np.ndarray, step: float) -> np.ndarray:
    return step * np.arange(np.ceil(values.min() / step), values.max() / step + 1e-9)


def _from_zero(longitude: np.ndarray) -> np.ndarray:
    """The same ascending longitudes, the first of them in [0, 360)."""
    return longitude - 360 * np.floor(longitude[0] / 360)


def _require_meridians(path: Path, data: xr.Dataset) -> None:
    for name, values in data.data_vars.items():
        others = [dim for dim in values.dims if dim != "longitude"]
        empty = values.isnull().all(others).to_numpy()
        # A variable that is masked everywhere is another matter.
        if empty.any() and not empty.all():
            first = float(data["longitude"].to_numpy()[empty][0])
            raise DataError(
                f"{path} lacks {empty.sum()} of {empty.size} meridians of {name!r}, "
                f"first that of {first:g} degrees: download it again."
            )


def _on_ascending_axes(path: Path, data: xr.Dataset) -> xr.Dataset:
    if min(data.sizes.get(axis, 1) for axis in ("latitude", "longitude")) < 2:
        raise DataError(
            f"{path} has a single latitude or longitude: get a wider region."
        )
    data = data.sortby("latitude")
    longitude = data["longitude"].to_numpy()
    east_of_first = (longitude - longitude[0]) % 360
    step = east_of_first[1]
    if np.isclose(east_of_first[-1], 0.0, atol=1e-3 * step):
        # 0 and 360 degrees are one meridian
        data, east_of_first = data.isel(longitude=slice(-1)), east_of_first[:-1]
    count = east_of_first.size
    uniform = np.allclose(np.diff(east_of_first), step, rtol=1e-2)
    if not uniform or np.isclose((count + 1) * step, 360.0):
        raise DataError(
            f"{path} lacks a meridian: its {count} longitudes, {step:g} degrees apart, "
            "neither close the circle nor leave it open, download it again."
        )
    ascending = _from_zero(longitude[0] + east_of_first)
    data = data.assign_coords(
        longitude=("longitude", ascending, data["longitude"].attrs)
    )
    if not np.isclose(count * step, 360.0):
        return data
    around = data.assign_coords(longitude=data["longitude"] % 360)
    return around.sortby("longitude")
