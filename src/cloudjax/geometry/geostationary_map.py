"""What a geostationary imager scans is a map: scan angles times its height."""

import functools as ft
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from .arrays import HostArray
from .column_grid import ColumnGrid
from .fixed_grid import FixedGrid
from .geodesy import GRS80, Ellipsoid
from .map_projections import AbstractMapProjection
from .rays import Rays


# Of latitude, for the direction of the meridian.
_STEP_DEG = 1e-4


@dataclass(frozen=True)
class GeostationaryMap(AbstractMapProjection):
    """A `GeostationaryMap` has the scan angles of a `FixedGrid` for axes.

    Its metres are those of the ground beneath the satellite (GOES-R PUG volume 3,
    section 5.1.2.8; PROJ's `geos`). Latitudes are geodetic, on the ellipsoid.

    **Fields:** as of `FixedGrid`.
    """

    subsatellite_longitude_deg: float
    perspective_height_m: float = 35786023.0
    ellipsoid: Ellipsoid = GRS80
    sweep: Literal["x", "y"] = "x"

    @staticmethod
    def of(grid: FixedGrid) -> "GeostationaryMap":
        """Return the map of an imager."""
        return GeostationaryMap(
            grid.subsatellite_longitude_deg,
            grid.perspective_height_m,
            grid.ellipsoid,
            grid.sweep,
        )

    def project(
        self,
        latitude_deg: Float[HostArray, "*n"],
        longitude_deg: Float[HostArray, "*n"],
    ) -> tuple[Float[HostArray, "*n"], Float[HostArray, "*n"]]:
        """Return scan angles times the height [m]; infinite where the satellite does
        not see the place.
        """
        x, y = self._imager.angles_of(latitude_deg, longitude_deg)
        return x * self.perspective_height_m, y * self.perspective_height_m

    def places(
        self, x_m: Float[np.ndarray, "*n"], y_m: Float[np.ndarray, "*n"]
    ) -> tuple[Float[np.ndarray, "*n"], Float[np.ndarray, "*n"]]:
        """Return latitude and longitude [degrees]; beyond the Earth's edge those of
        the place that the line of sight comes closest to.
        """
        height, shape = self.perspective_height_m, np.shape(x_m)
        direction = self._imager.directions(
            np.ravel(x_m) / height, np.ravel(y_m) / height
        )
        origin = np.broadcast_to(self._imager.satellite_m, direction.shape)
        ground, _ = Rays(origin, direction, 0.0).ground(self.ellipsoid)
        return ground.latitude_deg.reshape(shape), ground.longitude_deg.reshape(shape)

    def heading_rad(
        self,
        latitude_deg: Float[np.ndarray, "*n"],
        longitude_deg: Float[np.ndarray, "*n"],
    ) -> Float[np.ndarray, "*n"]:
        """Return the angle of the meridian, by differences along it.

        The map is not conformal: only north is turned right, and what is east of it is
        sheared.
        """
        x0, y0 = self.project(latitude_deg - _STEP_DEG, longitude_deg)
        x1, y1 = self.project(latitude_deg + _STEP_DEG, longitude_deg)
        return np.arctan2(-(x1 - x0), y1 - y0)

    @ft.cached_property
    def _imager(self) -> FixedGrid:
        nowhere = np.zeros(1)
        return FixedGrid(
            nowhere,
            nowhere,
            self.subsatellite_longitude_deg,
            self.perspective_height_m,
            self.ellipsoid,
            self.sweep,
        )


def column_grid(grid: FixedGrid, margin: int = 0) -> ColumnGrid:
    """Return columns where the pixels of an imager see the ground.

    **Arguments:** `margin`: so many more rows and columns on each side.
    """
    height = grid.perspective_height_m
    (x0, dx), (y0, dy) = (_first_and_step(a) for a in (grid.x_rad, grid.y_rad))
    return ColumnGrid(
        GeostationaryMap.of(grid),
        ((x0 - margin * dx) * height, (y0 - margin * dy) * height),
        (dx * height, dy * height),
        (grid.shape[0] + 2 * margin, grid.shape[1] + 2 * margin),
    )


def _first_and_step(angles: np.ndarray) -> tuple[float, float]:
    return float(angles[0]), float(angles[-1] - angles[0]) / (len(angles) - 1)
