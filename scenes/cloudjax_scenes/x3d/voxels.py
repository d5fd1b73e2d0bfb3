"""Voxels: the cloud of a box on a regular grid, for viewers that draw volumes."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8

from cloudjax_data import DataError

from .box import UP, Box
from .seen_cloud import SeenCloud


FEWEST, MOST = 8, 128
# Viewers lay slices across the diagonal of a volume, each of which has the opacity of
# the voxel there: so many has X_ITE at its medium quality, the usual one.
_SLICES = 400


@dataclass(frozen=True, eq=False)
class Voxels:
    """`Voxels` say how much cloud each part of a box of air has.

    **Fields:**

    - `box`: over which they are; `low_m`, `high_m`: their ends, upwards of its centre.
    - `depth`: optical depth of each, upwards through it; levels from below, rows from
      the north.
    """

    box: Box
    low_m: float
    high_m: float
    depth: Float[np.ndarray, "levels rows columns"]

    @property
    def size_m(self) -> tuple[float, float, float]:
        """Give how far they reach to the east, to the north and upwards."""
        return self.box.size_m, self.box.size_m, self.high_m - self.low_m

    @property
    def slice_m(self) -> float:
        """Give how far from each other slices of viewers are."""
        return float(np.linalg.norm(self.size_m)) / (_SLICES - 1)

    @property
    def opacity(self) -> UInt8[np.ndarray, "levels rows columns"]:
        """Give 1 - exp(-τ) of what a slice stands for in each voxel, 255 for 1."""
        per_m = self.depth * len(self.depth) / (self.high_m - self.low_m)
        return np.rint(-np.expm1(-per_m * self.slice_m) * 255).astype(np.uint8)

    def mean_opacity(self) -> float:
        """Return what slices with these bytes stop of light from straight below."""
        each = (self.high_m - self.low_m) / len(self.depth) / self.slice_m
        through = (1 - self.opacity / 255) ** each
        return float((1 - through.prod(axis=0)).mean())


def require_voxels(count: int, across: int) -> None:
    """Raise `DataError` for a number along each edge that is none.

    **Arguments:** `across`: pixels across the box, from which voxels are made.
    """
    if not FEWEST <= count <= MOST:
        raise DataError(
            f"volume = {count} is none: make it {FEWEST} to {MOST}, for the file has a "
            "number for each of its cubes."
        )
    if count > across:
        raise DataError(
            f"volume = {count} is finer than the {across} pixels across the box: give "
            f"--pixels {count} or more."
        )


def voxels_of(above: SeenCloud, count: int) -> Voxels:
    """Share out what is seen from above among so many voxels along each edge.

    No optical depth is lost but that of half a pixel about the edges.

    **Arguments:** `above`: the cloud, seen from straight above.
    """
    picture, box = above.picture, above.picture.box
    assert picture.sector is UP
    half = above.length_m / 2
    low = above.place[:, 2] - half
    high = above.place[:, 2] + half
    ends = np.linspace(low.min(), high.max(), count + 1)
    column = _column(picture.left_m, picture.shape[1], above, count)
    row = _column(-picture.top_m, picture.shape[0], above, count)
    # Pixels of each column of voxels, of which their depths are means.
    inside = (column[None] >= 0) & (row[:, None] >= 0)
    cell = np.where(inside, row[:, None] * count + column[None], 0).reshape(-1)
    pixels = np.bincount(cell, inside.reshape(-1), count**2)
    own = cell[above.ray]
    share = above.depth * inside.reshape(-1)[above.ray] / pixels[own]
    per_m = share / np.maximum(above.length_m, 1e-3)
    depth = np.zeros((count, count**2))
    for i in range(count):
        part = np.minimum(high, ends[i + 1]) - np.maximum(low, ends[i])
        depth[i] = np.bincount(own, per_m * np.maximum(part, 0), count**2)
    depth = depth.reshape(count, count, count)
    return Voxels(box, float(ends[0]), float(ends[-1]), depth)


def _column(first_m: float, pixels: int, above: SeenCloud, count: int):
    """The voxel that each pixel of an axis lies in; -1 beyond the box."""
    pitch, size = above.picture.pitch_m, above.picture.box.size_m
    middle = first_m + (np.arange(pixels) + 0.5) * pitch
    number = np.floor((middle / size + 0.5) * count).astype(int)
    return np.where((number >= 0) & (number < count), number, -1)
