"""netCDF files describe a fixed grid by the geostationary mapping of CF conventions."""

from typing import Any

import numpy as np
import xarray as xr

from cloudjax.geometry.fixed_grid import FixedGrid


GRID_MAPPING = "goes_imager_projection"


def cf_attributes(grid: FixedGrid) -> dict[str, Any]:
    """Return the attributes of a CF-1.8 `geostationary` grid mapping variable."""
    a, b = grid.ellipsoid.semi_major_m, grid.ellipsoid.semi_minor_m
    return {
        "grid_mapping_name": "geostationary",
        "perspective_point_height": grid.perspective_height_m,
        "semi_major_axis": a,
        "semi_minor_axis": b,
        "inverse_flattening": a / (a - b) if a > b else 0.0,
        "latitude_of_projection_origin": 0.0,
        "longitude_of_projection_origin": grid.subsatellite_longitude_deg,
        "sweep_angle_axis": grid.sweep,
    }


def fixed_grid_coordinates(grid: FixedGrid) -> dict[str, xr.DataArray]:
    """Return the xarray coordinates of a grid: `x`, `y` and the grid mapping variable.

    Pass them as `coords` of a Dataset or DataArray, and name the mapping in each
    variable: `encoding["grid_mapping"] = GRID_MAPPING`. (In the encoding, because
    xarray would list a mapping named in `attrs` as an ordinary coordinate too.)
    """
    return {
        "x": _axis(grid.x_rad, "x", "GOES fixed grid projection x-coordinate"),
        "y": _axis(grid.y_rad, "y", "GOES fixed grid projection y-coordinate"),
        GRID_MAPPING: xr.DataArray(np.int32(0), attrs=cf_attributes(grid)),
    }


def _axis(angles: np.ndarray, name: str, long_name: str) -> xr.DataArray:
    # "rad", as in ABI files: the readers in use multiply by the perspective height.
    attributes = {
        "standard_name": f"projection_{name}_coordinate",
        "long_name": long_name,
        "units": "rad",
        "axis": name.upper(),
    }
    return xr.DataArray(np.asarray(angles, np.float64), dims=name, attrs=attributes)
