"""Grids of weather models are brought to one orientation."""

from pathlib import Path

import numpy as np
import xarray as xr
from jaxtyping import Bool, Float

from .errors import DataError
from .lambert import LambertConic
from .weather_sky import SKY


# Of a cell: so far beyond the outermost points a place is among them.
_ROUNDING = 1e-3


def oriented(
    path: Path,
    data: xr.Dataset,
    projection: LambertConic | None,
    winds_along_grid: bool,
) -> xr.Dataset:
    """Return data with longitudes in their usual range and winds relative to Earth.

    A global grid starts next to 0. Raises `DataError` if a meridian is missing.
    """
    if projection is None:
        _require_meridians(path, data)
        return _on_usual_longitudes(path, data)
    return rotated_to_earth(data, projection) if winds_along_grid else data


def rotated_to_earth(data: xr.Dataset, projection: LambertConic) -> xr.Dataset:
    """Turn winds along the axes of the map to the true east and north."""
    angle = projection.rotation_rad(data["longitude"].to_numpy())
    sin, cos = np.sin(angle).astype(np.float32), np.cos(angle).astype(np.float32)
    u, v = data["u"], data["v"]
    east = u.copy(data=u.to_numpy() * cos + v.to_numpy() * sin)
    north = v.copy(data=v.to_numpy() * cos - u.to_numpy() * sin)
    return data.assign(u=east, v=north)


def on_plain_axes(
    data: xr.Dataset, projection: LambertConic, step_deg: float
) -> xr.Dataset:
    """Return Lambert data at the multiples of a step in latitude and longitude."""
    # scipy takes longer to import than a file to read
    from scipy.interpolate import RegularGridInterpolator

    latitude = _multiples(data["latitude"].to_numpy(), step_deg)
    longitude = _multiples(data["longitude"].to_numpy(), step_deg)
    x, y = projection.project(*np.meshgrid(latitude, longitude, indexing="ij"))
    points = np.stack([y, x], axis=-1)
    rows = projection.project(*(edge[:, 0] for edge in _positions(data)))[1]
    columns = projection.project(*(edge[0] for edge in _positions(data)))[0]

    def interpolated(values: xr.DataArray) -> xr.DataArray:
        table = values.transpose("y", "x", ...).to_numpy()
        found = RegularGridInterpolator((rows, columns), table, bounds_error=False)(
            points
        )
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


def _multiples(values: np.ndarray, step: float) -> np.ndarray:
    return step * np.arange(np.ceil(values.min() / step), values.max() / step + 1e-9)


def _from_zero(longitude: np.ndarray) -> np.ndarray:
    """The same ascending longitudes, the first of them in [0, 360)."""
    return longitude - 360 * np.floor(longitude[0] / 360)


def _require_meridians(path: Path, data: xr.Dataset) -> None:
    for name, values in data.data_vars.items():
        # Where nothing rises, it has no top.
        if name in SKY:
            continue
        others = [dim for dim in values.dims if dim != "longitude"]
        empty = values.isnull().all(others).to_numpy()
        # A variable that is masked everywhere is another matter.
        if empty.any() and not empty.all():
            first = float(data["longitude"].to_numpy()[empty][0])
            raise DataError(
                f"{path} lacks {empty.sum()} of {empty.size} meridians of {name!r}, "
                f"first that of {first:g} degrees: download it again."
            )


def _on_usual_longitudes(path: Path, data: xr.Dataset) -> xr.Dataset:
    longitude = data["longitude"].to_numpy()
    step = longitude[1] - longitude[0]
    if np.isclose(longitude[-1] - longitude[0], 360.0, rtol=0, atol=1e-3 * step):
        # 0 and 360 degrees are one meridian
        data, longitude = data.isel(longitude=slice(-1)), longitude[:-1]
    count = longitude.size
    if count < 2 or np.isclose((count + 1) * step, 360.0):
        raise DataError(
            f"{path} lacks a meridian: its {count} longitudes, {step:g} degrees apart, "
            "neither close the circle nor leave it open, download it again."
        )
    data = data.assign_coords(
        longitude=("longitude", _from_zero(longitude), data["longitude"].attrs)
    )
    if not np.isclose(count * step, 360.0):
        return data
    around = data.assign_coords(longitude=data["longitude"] % 360)
    return around.sortby("longitude")


def places_held(
    data: xr.Dataset,
    projection: LambertConic | None,
    known: Bool[np.ndarray, "rows columns"],
    latitude_deg: Float[np.ndarray, "*places"],
    longitude_deg: Float[np.ndarray, "*places"],
) -> Bool[np.ndarray, "*places"]:
    """Tell which places are within the grid, and all points next to them known."""
    if projection is None:
        row, column, around = _plain_positions(data, latitude_deg, longitude_deg)
    else:
        row, column = _map_positions(data, projection, latitude_deg, longitude_deg)
        around = False
    rows, columns = known.shape
    held = _within(row, rows) & (around | _within(column, columns))
    for i in (np.floor(row + _ROUNDING), np.ceil(row - _ROUNDING)):
        for j in (np.floor(column + _ROUNDING), np.ceil(column - _ROUNDING)):
            i_known = np.clip(np.nan_to_num(i), 0, rows - 1).astype(int)
            j_known = np.nan_to_num(j).astype(int)
            j_known = j_known % columns if around else np.clip(j_known, 0, columns - 1)
            held = held & known[i_known, j_known]
    return held


def _within(position: np.ndarray, count: int) -> np.ndarray:
    return (position >= -_ROUNDING) & (position <= count - 1 + _ROUNDING)


def _plain_positions(data: xr.Dataset, latitude_deg, longitude_deg):
    """Rows and columns of places, in cells, and whether columns close the circle."""
    latitude, longitude = (data[axis].to_numpy() for axis in ("latitude", "longitude"))
    dy, dx = latitude[1] - latitude[0], longitude[1] - longitude[0]
    row = (latitude_deg - latitude[0]) / dy
    # Beyond the last row the pole is next to it, where that is less than a cell away.
    reach = 1 + _ROUNDING
    if latitude[0] - reach * dy <= -90:
        row = np.maximum(row, 0)
    if latitude[-1] + reach * dy >= 90:
        row = np.minimum(row, latitude.size - 1)
    around = bool(np.isclose(longitude[-1] + dx - longitude[0], 360.0))
    # Counted from the opposite side, so that rounding at the first column is no turn.
    middle = (longitude[0] + longitude[-1]) / 2
    east = (longitude_deg - middle + 180) % 360 - 180 + middle
    return row, (east - longitude[0]) / dx, around


def _map_positions(data: xr.Dataset, projection: LambertConic, latitude, longitude):
    corner = [axis[[0, 0, 1], [0, 1, 0]] for axis in _positions(data)]
    x, y = projection.project(*corner)
    at_x, at_y = projection.project(np.asarray(latitude), np.asarray(longitude))
    return (at_y - y[0]) / (y[2] - y[0]), (at_x - x[0]) / (x[1] - x[0])


def _positions(data: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    return data["latitude"].to_numpy(), data["longitude"].to_numpy()
