"""Cells of latitude and longitude, and averages of an image's pixels over them."""

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import gaussian_filter

from cloudjax import FixedGrid
from cloudjax.geometry.geodesy import geodetic, intersect


# No cell is narrower than this.
LEAST_DEG = 0.03


class Cells:
    """`Cells` are a regular grid of latitude and longitude, over which pixels are
    averaged.
    """

    def __init__(self, latitude_deg, longitude_deg, step_deg):
        self.latitude_deg = latitude_deg
        self.longitude_deg = longitude_deg
        self.step_deg = step_deg

    @staticmethod
    def covering(
        grid: FixedGrid, good: Bool[np.ndarray, "y x"], pixels: int
    ) -> "Cells":
        """Make cells that are so many pixels wide, for all good pixels."""
        ground, hit = grid.rays().ground()
        seen = hit & good.reshape(-1)
        footprint = np.nanmedian(grid.rays().footprint_m()[seen])
        step = max(LEAST_DEG, pixels * footprint / 111e3)
        latitude = ground.latitude_deg[seen]
        # Relative to the satellite, so that no image is cut at the date line.
        east = _relative(ground.longitude_deg[seen], grid)
        rows = np.arange(latitude.min() - step, latitude.max() + 2 * step, step)
        columns = np.arange(east.min() - step, east.max() + 2 * step, step)
        return Cells(rows, columns + grid.subsatellite_longitude_deg, step)

    def total(self, latitude_deg, longitude_deg, weights) -> Float[np.ndarray, "a b"]:
        """Return the sum of weights over the pixels of each cell."""
        middle = self.longitude_deg.mean()
        east = (longitude_deg - middle + 180) % 360 - 180 + middle
        edges = [
            np.append(axis, axis[-1] + self.step_deg) - self.step_deg / 2
            for axis in (self.latitude_deg, self.longitude_deg)
        ]
        return np.histogram2d(latitude_deg, east, bins=edges, weights=weights)[0]

    def mean(
        self, latitude_deg, longitude_deg, values, weights=None
    ) -> Float[np.ndarray, "a b"]:
        """Return smooth averages; cells without pixels take from wider surroundings."""
        weights = np.ones(len(values)) if weights is None else weights
        total = self.total(latitude_deg, longitude_deg, weights * values)
        count = self.total(latitude_deg, longitude_deg, weights)
        result = np.full(total.shape, np.nan)
        for width in (1, 2, 4, 8, 16, 32, 64):
            pixels = gaussian_filter(count.astype(float), width, mode="constant")
            enough = pixels > 0.05
            mean = gaussian_filter(total, width, mode="constant") / np.where(
                enough, pixels, 1
            )
            result = np.where(np.isnan(result) & enough, mean, result)
        return np.where(np.isnan(result), total.sum() / max(count.sum(), 1), result)


def _relative(longitude_deg, grid: FixedGrid):
    return (longitude_deg - grid.subsatellite_longitude_deg + 180) % 360 - 180


def places_at(grid: FixedGrid, altitude_m: float):
    """Return where pixels look at an altitude, so that the parallax is undone.

    **Returns:** latitude and longitude [degrees], and whether they meet it; [pixels].
    """
    rays = grid.rays()
    near, _, hit = intersect(
        rays.origin_m, rays.direction, grid.ellipsoid.raised(altitude_m)
    )
    latitude, longitude, _ = geodetic(rays.at(near), grid.ellipsoid)
    return latitude, longitude, hit
