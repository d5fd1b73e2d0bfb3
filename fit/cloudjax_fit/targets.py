"""What a fit aims at: an observed scene, reduced to the little that a fit needs.

Quantiles and histograms of the cloud pixels, how much cloud of each class stands
where, what the clear pixels look like, and the geometry. A target is made from a
scene's files or read back from a small netCDF file, and is fitted in the same way.
"""

from dataclasses import dataclass
from datetime import datetime

import numpy as np
from jaxtyping import Float, Int

from cloudjax import FixedGrid
from cloudjax_scenes.cloud_rule import CloudRule

from .histogram import Quantiles


# Broad enough to hold dozens of rays each: with fewer, the derivative of a histogram
# jumps as rays change bins, and a solver creeps.
BINS = 32


@dataclass(frozen=True, eq=False)
class BandTarget:
    """One band of a target.

    **Fields:**

    - `number`, `wavelength_um`, `units`: of the band.
    - `coefficients`: `kappa0` where it sees the sun, `fk1`, `fk2`, `bc1`, `bc2` where
      it emits, as in the file; band 7 by day has all.
    - `quantiles`: of the cloud pixels' radiances.
    - `low`, `high`: the range of the histograms.
    - `block_counts`: histograms of the cloud pixels of each block of the image: what
      blocks differ by tells how sure the histogram is.
    - `background`: radiance without cloud on the target's grid.
    """

    number: int
    wavelength_um: float
    units: str
    coefficients: dict[str, float]
    quantiles: Quantiles
    low: float
    high: float
    block_counts: Int[np.ndarray, "blocks bins"]
    background: Float[np.ndarray, "lat lon"]

    @property
    def sunlit(self) -> bool:
        return "kappa0" in self.coefficients

    @property
    def reflective(self) -> bool:
        """Whether it is looked at in reflectance: whether it does not emit."""
        return "fk1" not in self.coefficients

    @property
    def name(self) -> str:
        return f"C{self.number:02d}"


@dataclass(frozen=True, eq=False)
class Target:
    """An observed scene, reduced.

    **Fields:**

    - `name`, `platform`, `time`: where the scene is from, middle of the scan.
    - `grid`: the fixed grid of the pixels, the coarsest of the bands'.
    - `rule`: which pixels count as cloud.
    - `bands`: by number.
    - `latitude_deg`, `longitude_deg`: of the grid of fractions and backgrounds.
    - `fractions`: of the sky covered by each class of cloud, as seen past those above.
    - `blocks`: rows and columns of blocks that the image is cut into.
    - `block_cloud`, `block_valid`: cloud pixels and good pixels of each block.
    """

    name: str
    platform: str
    time: datetime
    grid: FixedGrid
    rule: CloudRule
    bands: dict[int, BandTarget]
    latitude_deg: Float[np.ndarray, " lat"]
    longitude_deg: Float[np.ndarray, " lon"]
    fractions: dict[str, Float[np.ndarray, "lat lon"]]
    blocks: tuple[int, int]
    block_cloud: Int[np.ndarray, " blocks"]
    block_valid: Int[np.ndarray, " blocks"]

    @property
    def cloud_fraction(self) -> float:
        """Cloud pixels over good pixels."""
        return float(self.block_cloud.sum() / self.block_valid.sum())

    @property
    def sunlit(self) -> list[BandTarget]:
        return [band for band in self.bands.values() if band.sunlit]

    @property
    def emissive(self) -> list[BandTarget]:
        return [band for band in self.bands.values() if not band.reflective]


def block_of_pixels(
    shape: tuple[int, int], blocks: tuple[int, int]
) -> Int[np.ndarray, " pixels"]:
    """Which block each pixel of an image falls into, row by row."""
    rows = np.arange(shape[0]) * blocks[0] // shape[0]
    columns = np.arange(shape[1]) * blocks[1] // shape[1]
    return (rows[:, None] * blocks[1] + columns[None, :]).reshape(-1)
