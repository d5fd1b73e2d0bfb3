"""Columns of a model stand in rows on its map."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from .arrays import HostArray
from .geodesy import GRS80, Ellipsoid, ecef
from .map_projections import AbstractMapProjection


@dataclass(frozen=True)
class ColumnGrid:
    """A `ColumnGrid` has columns evenly spaced on a map, numbered from 0.

    **Fields:**

    - `projection`: the map.
    - `first_m`: x and y of the middle of the column in row 0 and column 0.
    - `spacing_m`: from column to column along x, and from row to row along y.
    - `shape`: numbers of rows and of columns.
    """

    projection: AbstractMapProjection
    first_m: tuple[float, float]
    spacing_m: tuple[float, float]
    shape: tuple[int, int]

    def index(
        self,
        latitude_deg: Float[HostArray, "*n"],
        longitude_deg: Float[HostArray, "*n"],
    ) -> tuple[Float[HostArray, "*n"], Float[HostArray, "*n"]]:
        """Return row and column of places, whole numbers in the middles of columns."""
        x, y = self.projection.project(latitude_deg, longitude_deg)
        (x0, y0), (dx, dy) = self.first_m, self.spacing_m
        return (y - y0) / dy, (x - x0) / dx

    def holds(
        self,
        latitude_deg: Float[np.ndarray, "*n"],
        longitude_deg: Float[np.ndarray, "*n"],
    ) -> Bool[np.ndarray, "*n"]:
        """Tell which places are over one of the columns."""
        row, column = (
            (index >= -0.5) & (index <= size - 0.5)
            for index, size in zip(
                self.index(latitude_deg, longitude_deg), self.shape, strict=True
            )
        )
        return row & column

    def places(
        self, row: Float[np.ndarray, "*n"], column: Float[np.ndarray, "*n"]
    ) -> tuple[Float[np.ndarray, "*n"], Float[np.ndarray, "*n"]]:
        """Return latitude and longitude [degrees] of rows and columns."""
        (x0, y0), (dx, dy) = self.first_m, self.spacing_m
        return self.projection.places(x0 + dx * column, y0 + dy * row)

    def mesh(self) -> tuple[Float[np.ndarray, "y x"], Float[np.ndarray, "y x"]]:
        """Return row and column of all columns."""
        rows, columns = (np.arange(n, dtype=float) for n in self.shape)
        row, column = np.meshgrid(rows, columns, indexing="ij")
        return row, column

    def steps_m(self, ellipsoid: Ellipsoid = GRS80) -> Float[np.ndarray, "y x 2 3"]:
        """Return the ways [m], ECEF on the ellipsoid, to the next row and column."""
        row, column = self.mesh()

        def at(north, east):
            φ, λ = self.places(row + north / 2, column + east / 2)
            return ecef(φ, λ, np.zeros_like(φ), ellipsoid)

        return np.stack([at(1, 0) - at(-1, 0), at(0, 1) - at(0, -1)], axis=-2)

    def per_m(self, ellipsoid: Ellipsoid = GRS80) -> Float[np.ndarray, "y x 2 3"]:
        """Return how row and column change along ECEF vectors, per metre.

        Only the level part of a vector changes them.
        """
        return np.swapaxes(np.linalg.pinv(self.steps_m(ellipsoid)), -1, -2)

    def area_m2(self) -> Float[np.ndarray, "y x"]:
        """Return the area of the ground beneath each column [m²]."""
        steps = self.steps_m()
        return np.linalg.norm(np.cross(steps[..., 0, :], steps[..., 1, :]), axis=-1)
