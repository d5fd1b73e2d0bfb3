"""An image within a netCDF file, whatever order its dimensions have."""

from dataclasses import dataclass

import netCDF4
import numpy as np

from .errors import DataError
from .image_part import Box
from .packed import counts, variable


@dataclass(frozen=True)
class ImagePlane:
    """An `ImagePlane` is a variable on rows and columns.

    **Fields:** `variable`; `rows`, `columns`: the places of these among its dimensions,
    of which all others have a size of 1.
    """

    variable: netCDF4.Variable
    rows: int
    columns: int

    @property
    def shape(self) -> tuple[int, int]:
        """Count the rows and columns."""
        shape = self.variable.shape
        return shape[self.rows], shape[self.columns]

    @property
    def chunks(self) -> tuple[int, int]:
        """Count the rows and columns of a chunk of the file."""
        chunks = self.variable.chunking()
        if not isinstance(chunks, list):
            return 1, self.shape[1]  # in one piece, row after row
        return chunks[self.rows], chunks[self.columns]

    def counts(self, pixels: Box) -> tuple[np.ndarray, np.ndarray]:
        """Return stored numbers [y, x] and where they are valid, as `packed.counts`."""
        where: list[slice | int] = [0] * self.variable.ndim
        where[self.rows], where[self.columns] = pixels
        stored, valid = counts(self.variable, tuple(where))
        return (stored.T, valid.T) if self.columns < self.rows else (stored, valid)


def image_plane(file: netCDF4.Dataset, name: str) -> ImagePlane:
    """Find a variable on the dimensions of the scan angles `y` and `x`.

    **Raises:** `DataError` if it is absent, on other dimensions, or empty.
    """
    found = variable(file, name)
    axes = [variable(file, axis).dimensions for axis in ("y", "x")]
    dimensions = found.dimensions
    fits = (
        all(len(axis) == 1 and axis[0] in dimensions for axis in axes)
        and axes[0] != axes[1]
        and len(set(dimensions)) == len(dimensions)
    )
    if fits:
        rows, columns = (dimensions.index(axis[0]) for axis in axes)
        others = set(range(found.ndim)) - {rows, columns}
        if all(found.shape[i] == 1 for i in others):
            return _with_pixels(ImagePlane(found, rows, columns))
    raise DataError(
        f"{file.filepath()} has {name!r} on the dimensions {', '.join(dimensions)} of "
        f"sizes {', '.join(map(str, found.shape))}, which make no single image on y and"
        " x: select one, or download it again."
    )


def _with_pixels(plane: ImagePlane) -> ImagePlane:
    if 0 in plane.shape:
        raise DataError(
            f"{plane.variable.group().filepath()} has no pixels in "
            f"{plane.variable.name!r}: download it again."
        )
    return plane
