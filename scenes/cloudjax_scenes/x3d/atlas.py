"""Many small pictures in one: a texture for all boards of a sector."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int, UInt8

from cloudjax_data import DataError

from .boards import Boards


# Clear texels about each board, so that no filter mixes neighbours.
_MARGIN = 1
# What every browser takes.
LARGEST = 4096


@dataclass(frozen=True, eq=False)
class Atlas:
    """An `Atlas` is a texture and where each board is in it.

    **Fields:**

    - `image`: red, green, blue and opacity, from the top.
    - `corners`: row and column of the first texel of each board.
    """

    image: UInt8[np.ndarray, "height width 4"]
    corners: Int[np.ndarray, "boards 2"]

    def inside(self, boards: Boards) -> Float[np.ndarray, "boards 4"]:
        """Return left, bottom, right and top of each board in the texture, 0 to 1."""
        height, width = self.image.shape[:2]
        sizes = np.array([board.alpha.shape for board in boards.boards])
        (top, left), (bottom, right) = self.corners.T, (self.corners + sizes).T
        return np.stack(
            [left / width, 1 - bottom / height, right / width, 1 - top / height], -1
        )


def atlas_of(boards: Boards, colours: UInt8[np.ndarray, "rows columns 3"]) -> Atlas:
    """Put the boards of a sector into one texture.

    **Arguments:** `colours`: of the cloud in each pixel of the boards' picture.

    **Raises:** `DataError` where they do not fit.
    """
    if not boards.boards:
        # All cloud is thinner than a byte can tell.
        return Atlas(np.zeros((1, 1, 4), np.uint8), np.zeros((0, 2), int))
    sizes = np.array([board.alpha.shape for board in boards.boards]) + 2 * _MARGIN
    width = _width(sizes)
    corners, height = _shelves(sizes, width)
    if max(width, height) > LARGEST:
        raise DataError(
            f"The pictures of {len(sizes)} boards need more than {LARGEST} x {LARGEST} "
            "texels: give fewer --pixels or fewer --boards."
        )
    image = np.zeros((height, width, 4), np.uint8)
    corners += _MARGIN
    rows, columns = boards.picture.shape
    for board, (top, left) in zip(boards.boards, corners, strict=True):
        deep, wide = board.alpha.shape
        # The margin has the colours of its surroundings, which filters mix in.
        around = image[
            top - _MARGIN : top + deep + _MARGIN, left - _MARGIN : left + wide + _MARGIN
        ]
        row = np.arange(board.rows.start - _MARGIN, board.rows.stop + _MARGIN)
        column = np.arange(board.columns.start - _MARGIN, board.columns.stop + _MARGIN)
        at = np.ix_(np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1))
        around[..., :3] = colours[at]
        image[top : top + deep, left : left + wide, 3] = board.alpha
    return Atlas(image, corners)


def _width(sizes: Int[np.ndarray, "boards 2"]) -> int:
    """A width for a texture about as high: a power of two."""
    area = float(sizes.prod(axis=1).sum()) * 1.1
    least = max(float(sizes.max()), np.sqrt(area))
    return int(2 ** np.ceil(np.log2(least)))


def _shelves(
    sizes: Int[np.ndarray, "boards 2"], width: int
) -> tuple[Int[np.ndarray, "boards 2"], int]:
    """Corners of pictures that stand on shelves, the highest first; and the height."""
    corners = np.zeros_like(sizes)
    top = left = shelf = 0
    for k in np.argsort(-sizes[:, 0], kind="stable"):
        deep, wide = sizes[k]
        if left + wide > width:
            top, left, shelf = top + shelf, 0, 0
        shelf = max(shelf, deep)
        corners[k] = top, left
        left += wide
    return corners, int(top + shelf)


def coarse_colours(
    colours: UInt8[np.ndarray, "rows columns 3"], coarser: int
) -> UInt8[np.ndarray, "coarse_rows coarse_columns 3"]:
    """Return means of colours over squares of pixels."""
    rows, columns = (n // coarser for n in colours.shape[:2])
    squares = colours.reshape(rows, coarser, columns, coarser, 3)
    return np.rint(squares.mean(axis=(1, 3))).astype(np.uint8)
