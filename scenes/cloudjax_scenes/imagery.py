"""An observed scene, reduced to what a rendered one needs: clouds, ground, geometry.

How much cloud of each class stands where, what the clear pixels look like, and how the
pixels look at them. `imagery_reduction.py` makes it of a scene's files.
"""

from dataclasses import dataclass
from datetime import datetime

import numpy as np
from jaxtyping import Float

from cloudjax import Band, FixedGrid

from .cloud_rule import CloudRule


@dataclass(frozen=True, eq=False)
class Imagery:
    """An observed scene.

    **Fields:**

    - `name`, `platform`, `time`: where the scene is from, middle of the scan.
    - `grid`: the fixed grid of the pixels, the coarsest of the bands'.
    - `rule`: which pixels count as cloud.
    - `bands`: by number. Band 7 sees the sun by day only.
    - `earth_sun_distance_au`: of the date.
    - `latitude_deg`, `longitude_deg`: of the grid of fractions and backgrounds.
    - `fractions`: of the sky covered by each class of cloud, as seen past those above.
    - `backgrounds`: radiance without cloud, by band.
    - `notes`: sentences on what had to be assumed.
    """

    name: str
    platform: str
    time: datetime
    grid: FixedGrid
    rule: CloudRule
    bands: dict[int, Band]
    earth_sun_distance_au: float
    latitude_deg: Float[np.ndarray, " lat"]
    longitude_deg: Float[np.ndarray, " lon"]
    fractions: dict[str, Float[np.ndarray, "lat lon"]]
    backgrounds: dict[int, Float[np.ndarray, "lat lon"]]
    notes: tuple[str, ...] = ()

    @property
    def sunlit(self) -> list[Band]:
        """The bands that see the sun."""
        return [band for band in self.bands.values() if band.sunlit]

    @property
    def emissive(self) -> list[Band]:
        """The bands that emit."""
        return [band for band in self.bands.values() if not band.reflective]

    def coefficients(self, number: int) -> dict[str, float]:
        """Return what radiance means in a band on the date: see `Band.coefficients`."""
        return self.bands[number].coefficients(self.earth_sun_distance_au)
