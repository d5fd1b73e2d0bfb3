"""An image that is larger than memory is read in parts: a window, averaged over blocks.

It is read tile by tile, along the chunks in which the file is compressed, so that each
chunk is unpacked once.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float32

from .errors import DataError


Box = tuple[slice, slice]

# With its counts, flags and means a tile of so many pixels takes about 30 MB.
_TILE_PIXELS = 2**20
# Where chunks and blocks meet more rarely than this, chunks are unpacked twice instead.
_LONGEST_UNIT = 2048


@dataclass(frozen=True)
class ImagePart:
    """An `ImagePart` is some rows and columns of an image, in blocks.

    **Fields:** `rows`, `columns`, with start and stop; `block`, the side of the blocks,
    which starts and stops are multiples of.
    """

    rows: slice
    columns: slice
    block: int

    @property
    def shape(self) -> tuple[int, int]:
        """Count the rows and columns of blocks."""
        return (
            (self.rows.stop - self.rows.start) // self.block,
            (self.columns.stop - self.columns.start) // self.block,
        )

    def tiles(self, chunks: Sequence[int]) -> Iterator[tuple[Box, Box]]:
        """Yield the pixels of the image to read, and the blocks of the part that they
        make.

        `chunks` has the rows and columns of a chunk of the file.
        """
        height, width = (_unit(chunk, self.block) for chunk in chunks)
        width *= max(_TILE_PIXELS // (height * width), 1)
        # A narrow image leaves room for more rows.
        height *= max(_TILE_PIXELS // (height * min(width, self.columns.stop)), 1)
        for rows in _cuts(self.rows, height):
            for columns in _cuts(self.columns, width):
                yield (rows, columns), (self._to(rows, 0), self._to(columns, 1))

    def _to(self, pixels: slice, axis: int) -> slice:
        first = (self.rows, self.columns)[axis].start
        return slice(
            (pixels.start - first) // self.block, (pixels.stop - first) // self.block
        )


def image_part(
    path: Path, shape: tuple[int, int], window: Box | None, block: int
) -> ImagePart:
    """Return the part of an image of that shape that somebody asked for.

    **Raises:** `DataError` if the window is not in the image, or blocks do not fill it.
    """
    if block < 1:
        raise DataError(f"A block of {block} pixels is none: use 1 or more for {path}.")
    ends = [
        _ends(path, size, asked, block)
        for size, asked in zip(shape, window or (slice(None),) * 2, strict=True)
    ]
    return ImagePart(ends[0], ends[1], block)


def block_means(
    values: Float32[np.ndarray, "y x"], good: Bool[np.ndarray, "y x"], block: int
) -> tuple[Float32[np.ndarray, "Y X"], Bool[np.ndarray, "Y X"]]:
    """Return means over blocks, NaN where one pixel is not good, and where all are
    good.
    """
    rows, columns = (size // block for size in values.shape)
    if block == 1:
        return np.where(good, values, np.float32(np.nan)), good
    blocks = (rows, block, columns, block)
    all_good = np.all(good.reshape(blocks), axis=(1, 3))
    # in float64, because summing counts of equal size in float32 loses the last digits
    mean = values.reshape(blocks).mean(axis=(1, 3), dtype=np.float64)
    return np.where(all_good, mean, np.nan).astype(np.float32), all_good


def _ends(path: Path, size: int, asked: slice, block: int) -> slice:
    start = 0 if asked.start is None else asked.start
    stop = size if asked.stop is None else asked.stop
    if asked.step not in (None, 1) or not 0 <= start < stop <= size:
        raise DataError(
            f"{path} has no pixels {start} to {stop} of {size}: ask for a window "
            "within the image."
        )
    if start % block or stop % block:
        raise DataError(
            f"{path} cannot be averaged over blocks of {block} pixels from {start} to "
            f"{stop}: ask for a window between multiples of {block}."
        )
    return slice(start, stop)


def _unit(chunk: int, block: int) -> int:
    """How far apart lie the lines along which an image can be cut into tiles."""
    common = math.lcm(chunk, block)
    return common if common <= max(_LONGEST_UNIT, chunk) else block * -(-chunk // block)


def _cuts(pixels: slice, step: int) -> Iterator[slice]:
    """The range cut at the multiples of a step."""
    start = pixels.start
    while start < pixels.stop:
        stop = min((start // step + 1) * step, pixels.stop)
        yield slice(start, stop)
        start = stop
