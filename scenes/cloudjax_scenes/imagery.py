"""An observed scene, reduced to what a rendered one needs: clouds, ground, geometry.

How much cloud of each class stands where, what the clear pixels look like, and how the
pixels look at them. `imagery_reduction.py` makes it of a scene's files.
"""

from dataclasses import dataclass, field
from datetime import datetime

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from cloudjax import (
    Band,
    EmissiveBands,
    FixedGrid,
    Rays,
    ReflectiveBands,
    Scene,
    TwoFlux,
)

from .background import Background
from .cloud_rule import CloudRule
from .imagery_evidence import ClassEvidence


@dataclass(frozen=True, eq=False)
class Imagery:
    """`Imagery` is an observed scene.

    **Fields:**

    - `name`, `platform`, `time`: where the scene is from, middle of the scan.
    - `grid`: the fixed grid of the pixels, the coarsest of the bands'.
    - `rule`: which pixels count as cloud.
    - `bands`: by number. Band 7 sees the sun by day only.
    - `earth_sun_distance_au`: of the date.
    - `latitude_deg`, `longitude_deg`: of the grid of fractions.
    - `fractions`: of the sky covered by each class of cloud, as seen past those above.
    - `background`: radiance without cloud.
    - `evidence`: what the clouds of each class are like from place to place, as far as
      the bands tell.
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
    background: Background
    evidence: dict[str, ClassEvidence] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def on_earth(self) -> tuple[Rays, Bool[np.ndarray, " pixels"]]:
        """Return the rays that see the Earth, and which of all pixels do."""
        every = self.grid.rays()
        _, hit = every.ground(self.grid.ellipsoid)
        return every[hit], hit

    @property
    def sunlit(self) -> list[Band]:
        """Give the bands that see the sun."""
        return [band for band in self.bands.values() if band.sunlit]

    @property
    def emissive(self) -> list[Band]:
        """Give the bands that emit."""
        return [band for band in self.bands.values() if not band.reflective]

    @property
    def empty_scene(self) -> Scene:
        """Give a scene of these bands and nothing else, to say what radiances mean."""
        return Scene(
            layers=(),
            reflective=ReflectiveBands.of(self.sunlit, self.earth_sun_distance_au),
            emissive=EmissiveBands.of(self.emissive),
            reflection=TwoFlux(indirect=jnp.asarray(0.0)),
        )

    def coefficients(self, number: int) -> dict[str, float]:
        """Return what radiance means in a band on the date: see `Band.coefficients`."""
        return self.bands[number].coefficients(self.earth_sun_distance_au)
