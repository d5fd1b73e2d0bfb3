"""Boards: pictures of sections of cloud, with a place in the box.

Seen from the direction that they are made for, boards together let as much light pass
as the cloud itself does, pixel by pixel, and have its colour.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int, UInt8

from .box import Picture
from .sections import Sections


@dataclass(frozen=True, eq=False)
class Board:
    """A `Board` is a rectangle that faces the viewers of a sector.

    **Fields:**

    - `rows`, `columns`: of the picture that it covers, as slices.
    - `middle_m`, `slope`: of its section.
    - `alpha`: its opacity, 255 for 1.
    """

    rows: slice
    columns: slice
    middle_m: Float[np.ndarray, "3"]
    slope: Float[np.ndarray, "2"]
    alpha: UInt8[np.ndarray, "rows columns"]


@dataclass(frozen=True, eq=False)
class Boards:
    """`Boards` are all boards of a sector, from the farthest to the nearest.

    **Fields:**

    - `picture`: the raster that they are parts of.
    - `boards`: one for each section that is seen.
    """

    picture: Picture
    boards: Sequence[Board]

    def opacity(self) -> Float[np.ndarray, "rows columns"]:
        """Return what all of them together take from the light, seen from afar."""
        through = np.ones(self.picture.shape)
        for board in self.boards:
            through[board.rows, board.columns] *= 1 - board.alpha / 255
        return 1 - through


def boards_of(picture: Picture, sections: Sections, coarser: int = 1) -> Boards:
    """Make the boards of sections, front to back.

    **Arguments:** `coarser`: pixels along each axis that become one.
    """
    raster = _coarse(picture, coarser)
    to_coarse = _coarse_index(picture.shape, coarser)
    # Of the light from behind: what should pass so far, and what bytes let pass.
    wanted: np.ndarray = np.ones(picture.shape[0] * picture.shape[1])
    mean: np.ndarray = np.ones(raster.shape[0] * raster.shape[1])
    passed = mean.copy()
    boards = []
    for k in np.argsort(-sections.middle_m[:, 2], kind="stable"):
        start, end = sections.depth.indptr[k : k + 2]
        rays, depth = sections.depth.indices[start:end], sections.depth.data[start:end]
        before = wanted[rays]
        wanted[rays] = before * np.exp(-depth)
        pixels, place = np.unique(to_coarse[rays], return_inverse=True)
        lost = np.bincount(place, before - wanted[rays]) / coarser**2
        alpha = _as_bytes(mean[pixels], lost, passed[pixels])
        mean[pixels] -= lost
        passed[pixels] *= 1 - alpha.astype(float) / 255
        if alpha.any():
            plane = sections.middle_m[k], sections.slope[k]
            boards.append(_board(raster, pixels, alpha, *plane))
    return Boards(raster, boards[::-1])


def _as_bytes(
    before: Float[np.ndarray, " pixels"],
    lost: Float[np.ndarray, " pixels"],
    passed: Float[np.ndarray, " pixels"],
) -> UInt8[np.ndarray, " pixels"]:
    """Opacities in bytes, that make good what bytes in front have rounded."""
    own = np.clip(lost / np.maximum(before, 1e-9), 0, 1)
    # Far in the dark the board's own opacity counts, for those who look elsewhere from.
    right = 1 - (before - lost) / np.maximum(passed, 1e-9)
    chosen = np.where(before > 0.02, np.clip(right, own - 1 / 255, own + 1 / 255), own)
    return np.rint(np.clip(chosen, 0, 1) * 255).astype(np.uint8)


def _board(raster: Picture, pixels, alpha, middle_m, slope) -> Board:
    seen = alpha > 0
    row, column = np.divmod(pixels[seen], raster.shape[1])
    rows, columns = (slice(int(x.min()), int(x.max()) + 1) for x in (row, column))
    image = np.zeros((rows.stop - rows.start, columns.stop - columns.start), np.uint8)
    image[row - rows.start, column - columns.start] = alpha[seen]
    return Board(rows, columns, middle_m, slope, image)


def _coarse(picture: Picture, coarser: int) -> Picture:
    rows, columns = picture.shape
    return Picture(
        picture.box,
        picture.sector,
        picture.left_m,
        picture.top_m,
        picture.pitch_m * coarser,
        (rows // coarser, columns // coarser),
    )


def _coarse_index(shape, coarser: int) -> Int[np.ndarray, " rays"]:
    rows, columns = shape
    row, column = np.divmod(np.arange(rows * columns), columns)
    return row // coarser * (columns // coarser) + column // coarser
