"""Far away fewer particles serve, and each stands for more.

The laws of particle systems say only how many are left. The optical depth of those that
go, the ones that stay have to carry.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from .cloud_particles import CloudParticles


@dataclass(frozen=True)
class LevelOfDetail:
    """A `LevelOfDetail` keeps N (L₀/L)^p of N particles at the distance L.

    **Fields:**

    - `near_m`: L₀, the distance up to which all are kept.
    - `power`: p, 1 for the law of lengths and 3 for that of volumes.

    **Raises:** `ValueError` where one is not positive.
    """

    near_m: float
    power: float = 3.0

    def __post_init__(self):
        if not (self.near_m > 0 and self.power > 0):
            raise ValueError(
                f"A level of detail from {self.near_m:g} m with the power "
                f"{self.power:g} is none: make both more than 0."
            )

    def share(self, distance_m: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
        """Return the share that is kept at distances, 1 - η of the literature."""
        far = np.maximum(distance_m / self.near_m, 1.0)
        return far**-self.power

    def thinned(
        self,
        particles: CloudParticles,
        distance_m: Float[np.ndarray, " particles"],
        seed: int = 0,
    ) -> CloudParticles:
        """Keep some, that stand for all: the sum of extinction areas stays.

        Radii grow with the cube root of what a particle stands for, that is with the
        distance for the law of volumes; so optical depths of single ones grow alike.
        One at least is kept.

        **Arguments:** `distance_m`: of each particle from the viewer.
        """
        share = self.share(distance_m)
        ends = np.cumsum(share)
        count = max(round(float(ends[-1])), 1)
        at = (np.random.default_rng(seed).uniform() + np.arange(count)) / count
        kept = np.searchsorted(ends, at * ends[-1], side="right")
        kept = np.minimum(kept, len(particles) - 1)
        some = particles[kept]
        area = some.extinction_area_m2 / share[kept]
        area = area * (particles.extinction_area_m2.sum() / area.sum())
        grown = np.cbrt(area / some.extinction_area_m2)
        return replace(some, extinction_area_m2=area, radius_m=some.radius_m * grown)
