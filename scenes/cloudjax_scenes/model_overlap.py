"""Which pixels of an image lie over the columns of a weather model."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from cloudjax import FixedGrid
from cloudjax.geometry.column_grid import ColumnGrid
from cloudjax_data import WrfColumns
from cloudjax_data.wrf import LEAST_CONTENT

from .cells import places_at
from .scene_places import scene_places


@dataclass(frozen=True, eq=False)
class Overlap:
    """An `Overlap` is the part of an image that lies over the columns of a model.

    **Fields:**

    - `grid`: the smallest box that holds these pixels.
    - `over`: which pixels of the box they are; along their lines of sight there are
      columns from the top of the highest cloud down to the ground.
    - `of_image`: their share of the pixels that see the Earth.
    - `of_columns`: share of the columns that are in the image.
    """

    grid: FixedGrid
    over: Bool[np.ndarray, "y x"]
    of_image: float
    of_columns: float


def overlap_of(grid: FixedGrid, columns: WrfColumns) -> Overlap | None:
    """Find where an image and a model overlap; None where they do not."""
    edges = np.stack(places_of(columns.grid, 0.5))
    angles = np.stack(grid.angles_of(*edges))
    seen = np.isfinite(angles[0])
    if not seen.any():
        return None
    box = _between(grid, *angles[:, seen])
    if 0 in box.shape:
        return None
    over = np.logical_and.reduce(
        [
            columns.grid.holds(latitude, longitude) & hit
            for latitude, longitude, hit in (
                places_at(box, altitude_m) for altitude_m in (0.0, cloud_top_m(columns))
            )
        ]
    ).reshape(box.shape)
    if not over.any():
        return None
    rows, columns_held = (np.flatnonzero(over.any(axis)) for axis in (1, 0))
    part = (
        slice(rows[0], rows[-1] + 1),
        slice(columns_held[0], columns_held[-1] + 1),
    )
    return Overlap(
        replace(box, y_rad=box.y_rad[part[0]], x_rad=box.x_rad[part[1]]),
        over[part],
        _share_of_image(grid, columns.grid),
        _share_of_columns(grid, columns.grid),
    )


def cloud_top_m(columns: WrfColumns) -> float:
    """Return the altitude of the top of the highest cloud [m], 0 without any."""
    cloudy = np.logical_or.reduce(
        [part.content_g_m3 > LEAST_CONTENT for part in columns.condensate]
    )
    return float(np.max(columns.heights_m[1:], initial=0.0, where=cloudy))


def places_of(
    grid: ColumnGrid, beyond: float = 0.0
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Return latitudes and longitudes [degrees] of all columns; half a column `beyond`,
    of their corners.
    """
    row, column = (
        np.arange(-beyond, n - 1 + beyond + 0.25, dtype=float) for n in grid.shape
    )
    places = grid.places(*np.meshgrid(row, column, indexing="ij"))
    return places[0].ravel(), places[1].ravel()


def _between(grid: FixedGrid, x_rad, y_rad) -> FixedGrid:
    """The pixels within the least and the greatest scan angles, which may be none."""
    within = [
        own[(own >= angles.min()) & (own <= angles.max())]
        for own, angles in ((grid.x_rad, x_rad), (grid.y_rad, y_rad))
    ]
    return replace(grid, x_rad=within[0], y_rad=within[1])


def _share_of_image(grid: FixedGrid, columns: ColumnGrid) -> float:
    held = columns.holds(*scene_places(grid))
    return float(held.mean()) if held.size else 0.0


def _share_of_columns(grid: FixedGrid, columns: ColumnGrid) -> float:
    x, y = grid.angles_of(*places_of(columns))
    half = grid.step_rad / 2
    inside = [
        (angle >= own.min() - half) & (angle <= own.max() + half)
        for angle, own in ((x, grid.x_rad), (y, grid.y_rad))
    ]
    return float((inside[0] & inside[1]).mean())
