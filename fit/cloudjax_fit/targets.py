"""What a fit aims at: imagery, and the statistics of its cloud pixels.

A target is made from a scene's files or read back from a small netCDF file, and is
fitted in the same way.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from cloudjax_scenes.imagery import Imagery

from .histogram import Quantiles


# Broad enough to hold dozens of rays each: with fewer, the derivative of a histogram
# jumps as rays change bins, and a solver creeps.
BINS = 32


@dataclass(frozen=True, eq=False)
class BandStatistics:
    """The cloud pixels of one band.

    **Fields:**

    - `quantiles`: of their radiances.
    - `low`, `high`: the range of the histograms.
    - `block_counts`: histograms of each block of the image: what blocks differ by tells
      how sure the histogram is.
    """

    quantiles: Quantiles
    low: float
    high: float
    block_counts: Int[np.ndarray, "blocks bins"]


@dataclass(frozen=True, eq=False)
class Target:
    """An observed scene, reduced.

    **Fields:**

    - `imagery`: what a scene that looks like it is built of.
    - `statistics`: of the cloud pixels, by band.
    - `blocks`: rows and columns of blocks that the image is cut into.
    - `block_cloud`, `block_valid`: cloud pixels and good pixels of each block.
    - `good`: the pixels that the statistics are of; None where a file of an earlier
      version does not tell them: then those of blocks that hold any.
    """

    imagery: Imagery
    statistics: dict[int, BandStatistics]
    blocks: tuple[int, int]
    block_cloud: Int[np.ndarray, " blocks"]
    block_valid: Int[np.ndarray, " blocks"]
    good: Bool[np.ndarray, "y x"] | None = None

    @property
    def counted(self) -> Bool[np.ndarray, "y x"]:
        """The pixels that count: what lies elsewhere is compared with nothing."""
        if self.good is not None:
            return self.good
        shape = self.imagery.grid.shape
        return (self.block_valid > 0)[block_of_pixels(shape, self.blocks)].reshape(
            shape
        )

    @property
    def block_share(self) -> Float[np.ndarray, " blocks"]:
        """The share of each block's pixels that is good."""
        block = block_of_pixels(self.imagery.grid.shape, self.blocks)
        pixels = np.bincount(block, minlength=len(self.block_valid))
        return self.block_valid / np.maximum(pixels, 1)

    @property
    def cloud_fraction(self) -> float:
        """Cloud pixels over good pixels."""
        return float(self.block_cloud.sum() / self.block_valid.sum())


def block_of_pixels(
    shape: tuple[int, int], blocks: tuple[int, int]
) -> Int[np.ndarray, " pixels"]:
    """Return which block each pixel of an image falls into, row by row."""
    rows = np.arange(shape[0]) * blocks[0] // shape[0]
    columns = np.arange(shape[1]) * blocks[1] // shape[1]
    return (rows[:, None] * blocks[1] + columns[None, :]).reshape(-1)
