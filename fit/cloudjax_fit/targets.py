"""What a fit aims at: imagery, and the statistics of its pixels.

A target is made from a scene's files or read back from a small netCDF file, and is
fitted in the same way.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from cloudjax_scenes.imagery import Imagery
from cloudjax_scenes.simulated_image import SimulatedImage

from .histogram import Distances, Quantiles, distances
from .statistics import Coverage, Statistics


@dataclass(frozen=True, eq=False)
class Target:
    """A `Target` is an observed scene, reduced to what a fit compares.

    **Fields:**

    - `imagery`: what a scene that looks like it is built of.
    - `quantiles`: of the radiances of cloud, by band.
    - `statistics`: that a fit compares, of the bands in the order of `quantiles`.
    - `blocks`: rows and columns of blocks that the image is cut into.
    - `good`: the pixels that the statistics are of.
    """

    imagery: Imagery
    quantiles: dict[int, Quantiles]
    statistics: Statistics
    blocks: tuple[int, int]
    good: Bool[np.ndarray, "y x"]

    @property
    def block_valid(self) -> Int[np.ndarray, " blocks"]:
        """Give the number of good pixels of each block."""
        block = block_of_pixels(self.imagery.grid.shape, self.blocks)
        count = self.blocks[0] * self.blocks[1]
        return np.bincount(block[self.good.reshape(-1)], minlength=count)

    @property
    def block_cloud(self) -> Float[np.ndarray, " blocks"]:
        """Give the cloud of each block, in pixels."""
        return np.asarray(self._coverage.observed, float)[:, 0, 0]

    @property
    def block_share(self) -> Float[np.ndarray, " blocks"]:
        """Give the share of each block's pixels that is good."""
        block = block_of_pixels(self.imagery.grid.shape, self.blocks)
        pixels = np.bincount(block, minlength=len(self.block_valid))
        return self.block_valid / np.maximum(pixels, 1)

    @property
    def cloud_fraction(self) -> float:
        """Give cloud over good pixels."""
        return float(self.block_cloud.sum() / self.good.sum())

    def distances(self, image: SimulatedImage) -> dict[int, Distances]:
        """Return how far the clouds of an image are from those observed, by band."""
        weights = image.cloud[self.good]
        return {
            number: distances(table, image.band(number)[self.good], weights)
            for number, table in self.quantiles.items()
        }

    @property
    def _coverage(self) -> Coverage:
        return self.statistics.coverage


def block_of_pixels(
    shape: tuple[int, int], blocks: tuple[int, int]
) -> Int[np.ndarray, " pixels"]:
    """Return which block each pixel of an image falls into, row by row."""
    rows = np.arange(shape[0]) * blocks[0] // shape[0]
    columns = np.arange(shape[1]) * blocks[1] // shape[1]
    return (rows[:, None] * blocks[1] + columns[None, :]).reshape(-1)
