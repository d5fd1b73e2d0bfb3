"""The ABI fixed grid holds scan angles of pixel centres as seen from a satellite."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import xarray as xr
from jaxtyping import Float64


GRID_MAPPING = "goes_imager_projection"

# A quarter of a percent of the finest ABI pixel (14 microradians), and ten times what
# rounding scale and offset to six decimals can move a centre by.
SAME_CENTRE_RAD = 1e-7


@dataclass(frozen=True, eq=False)
class FixedGrid:
    """A `FixedGrid` says where the pixels of an image look, and from where.

    **Fields:**

    - `x_rad`, `y_rad`: scan angles of the pixel centres; x grows eastward, and y falls
        from the first row, the northernmost, to the last.
    - `subsatellite_longitude_deg`: the longitude of the *projection*, east positive;
        the satellite itself may drift some tenths of a degree about it.
    - `perspective_height_m`: height of the projection point above the ellipsoid.
    - `semi_major_axis_m`, `semi_minor_axis_m`: the ellipsoid.
    - `sweep`: the scan axis of the instrument, "x" for GOES-R.
    """

    x_rad: Float64[np.ndarray, " x"]
    y_rad: Float64[np.ndarray, " y"]
    subsatellite_longitude_deg: float
    perspective_height_m: float = 35786023.0
    semi_major_axis_m: float = 6378137.0
    semi_minor_axis_m: float = 6356752.31414
    sweep: Literal["x", "y"] = "x"

    @property
    def shape(self) -> tuple[int, int]:
        """Count the rows and columns."""
        return self.y_rad.size, self.x_rad.size

    @property
    def step_rad(self) -> float:
        """Give the distance [radians] between neighbouring columns or, of a single one,
        rows.
        """
        angles = self.x_rad if self.x_rad.size > 1 else self.y_rad
        return float(abs(angles[-1] - angles[0]) / max(angles.size - 1, 1))

    def cf_attributes(self) -> dict[str, Any]:
        """Return the attributes of a CF-1.8 `geostationary` grid mapping variable."""
        a, b = self.semi_major_axis_m, self.semi_minor_axis_m
        return {
            "grid_mapping_name": "geostationary",
            "perspective_point_height": self.perspective_height_m,
            "semi_major_axis": a,
            "semi_minor_axis": b,
            "inverse_flattening": a / (a - b) if a > b else 0.0,
            "latitude_of_projection_origin": 0.0,
            "longitude_of_projection_origin": self.subsatellite_longitude_deg,
            "sweep_angle_axis": self.sweep,
        }

    def same_as(self, other: "FixedGrid") -> bool:
        """Tell whether both grids have the same pixels, within `SAME_CENTRE_RAD`."""
        return (
            self.shape == other.shape
            and self.cf_attributes() == other.cf_attributes()
            and _close(self.x_rad, other.x_rad)
            and _close(self.y_rad, other.y_rad)
        )

    def coarsened(self, factor: int) -> "FixedGrid":
        """Return the grid of blocks of `factor` by `factor` pixels.

        Raises `ValueError` when the blocks do not fill the grid.
        """
        return FixedGrid(
            _block_centres(self.x_rad, factor),
            _block_centres(self.y_rad, factor),
            self.subsatellite_longitude_deg,
            self.perspective_height_m,
            self.semi_major_axis_m,
            self.semi_minor_axis_m,
            self.sweep,
        )


def fixed_grid_coordinates(grid: FixedGrid) -> dict[str, xr.DataArray]:
    """Return the xarray coordinates of a grid: `x`, `y` and the grid mapping variable.

    Pass them as `coords` of a Dataset or DataArray, and name the mapping in each
    variable: `encoding["grid_mapping"] = GRID_MAPPING`. (In the encoding, because
    xarray would list a mapping named in `attrs` as an ordinary coordinate too.)
    """
    return {
        "x": _axis(grid.x_rad, "x", "GOES fixed grid projection x-coordinate"),
        "y": _axis(grid.y_rad, "y", "GOES fixed grid projection y-coordinate"),
        GRID_MAPPING: xr.DataArray(np.int32(0), attrs=grid.cf_attributes()),
    }


def _axis(angles: np.ndarray, name: str, long_name: str) -> xr.DataArray:
    # "rad", as in ABI files: the readers in use multiply by the perspective height.
    attributes = {
        "standard_name": f"projection_{name}_coordinate",
        "long_name": long_name,
        "units": "rad",
        "axis": name.upper(),
    }
    return xr.DataArray(angles, dims=name, attrs=attributes)


def _block_centres(angles: np.ndarray, factor: int) -> np.ndarray:
    if angles.size % factor:
        raise ValueError(
            f"{angles.size} pixels cannot be cut into blocks of {factor}: "
            "choose a divisor."
        )
    return angles.reshape(-1, factor).mean(axis=1)


def _close(a: np.ndarray, b: np.ndarray) -> bool:
    return bool(np.all(np.abs(a - b) < SAME_CENTRE_RAD))
