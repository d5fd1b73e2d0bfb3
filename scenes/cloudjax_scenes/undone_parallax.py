"""Clouds of an image are put where they stand: nearer to the satellite than the ground
behind them, the more the higher they are.

Columns stand in rows, clouds between them once they are moved. Each column takes the
pixel that comes to stand nearest to it, and all of what that pixel tells: nothing is
averaged, and the edges of clouds stay sharp. Pixels without cloud move as the nearest
cloud does, for their lines of sight are clear at its height too.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.ndimage import distance_transform_edt, maximum_filter, minimum_filter

from cloudjax import FixedGrid
from cloudjax.geometry.column_grid import ColumnGrid
from cloudjax.geometry.geodesy import dot, geodetic, intersect, up


# Rounds of Newton's method; two leave less than a centimetre.
_ROUNDS = 3


def standing_places(
    grid: FixedGrid, height_m: Float[np.ndarray, "y x"]
) -> tuple[Float[np.ndarray, "y x"], Float[np.ndarray, "y x"]]:
    """Return latitude and longitude [degrees] at which lines of sight of pixels are at
    a height of their own [m].

    NaN where a pixel does not see the Earth.
    """
    rays, wanted = grid.rays(), height_m.reshape(-1)
    distance, _, hit = intersect(rays.origin_m, rays.direction, grid.ellipsoid)
    for _ in range(_ROUNDS):
        latitude, longitude, height = geodetic(rays.at(distance), grid.ellipsoid)
        sinking = -dot(rays.direction, up(latitude, longitude))
        distance = distance + (height - wanted) / np.maximum(sinking, 0.01)
    latitude, longitude, _ = geodetic(rays.at(distance), grid.ellipsoid)
    found = (np.where(hit, place, np.nan) for place in (latitude, longitude))
    latitude, longitude = (place.reshape(grid.shape) for place in found)
    return latitude, longitude


@dataclass(frozen=True, eq=False)
class Standing:
    """A `Standing` tells which pixel stands in each column.

    **Fields:**

    - `pixel`: flat index of the pixel, -1 for none.
    - `cloudy`: which columns have cloud.
    """

    pixel: Int[np.ndarray, "y x"]
    cloudy: Bool[np.ndarray, "y x"]

    @property
    def nearest(self) -> Int[np.ndarray, "y x"]:
        """Give the pixel of the nearest cloud to each column."""
        return self.pixel[tuple(_nearest(self.cloudy))]


def moved(
    grid: FixedGrid,
    columns: ColumnGrid,
    cloudy: Bool[np.ndarray, "y x"],
    height_m: Float[np.ndarray, "y x"],
) -> Float[np.ndarray, "2 y x"]:
    """Return row and column, among columns, where pixels come to stand.

    **Arguments:** `height_m`: of the clouds, where there are some.
    """
    height = height_m[tuple(_nearest(cloudy))]
    return np.stack(columns.index(*standing_places(grid, height)))


def stand(
    at: Float[np.ndarray, "2 y x"],
    cloudy: Bool[np.ndarray, "y x"],
    shape: tuple[int, int],
) -> Standing:
    """Choose the pixel of each column.

    A cloud that comes to stand within half a column of it goes before clear sky, what
    is nearer before what is further. Columns that nothing comes to stand in, between
    others, are hidden from the satellite behind higher cloud: they take what stands
    nearest.

    **Arguments:** `at`: of `moved`; `shape`: of the columns.
    """
    column, source = _claims(at, cloudy, shape)
    pixel = np.full(shape, -1)
    # The last of several claims to a column stays.
    pixel.reshape(-1)[column] = source
    claimed = pixel >= 0
    hidden = ~claimed & _closed(claimed, _spread(at, cloudy))
    pixel = np.where(hidden, pixel[tuple(_nearest(claimed))], pixel)
    return Standing(pixel, (pixel >= 0) & cloudy.reshape(-1)[pixel])


def _claims(at, cloudy, shape):
    """Columns and pixels that may stand there, the best last."""
    row, column = (a.reshape(-1) for a in at)
    seen = np.flatnonzero(np.isfinite(row) & np.isfinite(column))
    row, column, cloud = row[seen], column[seen], cloudy.reshape(-1)[seen]
    found = []
    for i in (0, 1):
        for j in (0, 1):
            r, c = np.floor(row) + i, np.floor(column) + j
            off = np.maximum(np.abs(row - r), np.abs(column - c))
            inside = (r >= 0) & (r < shape[0]) & (c >= 0) & (c < shape[1])
            flat = (r * shape[1] + c)[inside].astype(int)
            found.append((flat, seen[inside], off[inside], cloud[inside]))
    flat, source, off, cloud = (
        np.concatenate(part) for part in zip(*found, strict=True)
    )
    own = off <= 0.5
    order = np.lexsort((-off, cloud, own))
    return flat[order], source[order]


def _spread(at, cloudy) -> int:
    """By how many columns, at most, the ways of clouds differ from the usual one."""
    ways = (at - np.indices(cloudy.shape))[:, cloudy & np.isfinite(at[0])]
    usual = np.median(ways, axis=1, keepdims=True)
    return int(np.ceil(np.abs(ways - usual).max(initial=0.0)))


def _closed(claimed, width: int):
    """Fill what lies between what is claimed, up to so far on each side."""
    around = np.pad(claimed, width + 1)
    size = 2 * width + 1
    closed = minimum_filter(maximum_filter(around, size), size)
    return np.asarray(closed, bool)[width + 1 : -width - 1, width + 1 : -width - 1]


def _nearest(known: Bool[np.ndarray, "y x"]) -> Int[np.ndarray, "2 y x"]:
    found = distance_transform_edt(~known, return_distances=False, return_indices=True)
    return np.asarray(found)
