"""Particles stand for cloud: each has a place, a size, a speed, an area that stops
light, and a life."""

from dataclasses import dataclass, fields, replace

import numpy as np
from jaxtyping import Float

from cloudjax.geometry.geodesy import MEAN_RADIUS_M, ecef, up


PerParticle = Float[np.ndarray, " particles"]


@dataclass(frozen=True, eq=False)
class CloudParticles:
    """`CloudParticles` are blobs of cloud, in float64 on the host.

    **Fields:**

    - `latitude_deg`, `longitude_deg`, `altitude_m`: of the middles.
    - `radius_m`: of the sphere that a particle stands for.
    - `extinction_area_m2`: what it takes from light, an optical depth over an area; the
      sum over particles is that of the cloud.
    - `velocity_m_s`: to the east, to the north and upwards.
    - `birth_s`, `death_s`: its life, on the clock of the model's time.
    - `ice_share`: how much of its extinction is of ice; the rest is of water.
    """

    latitude_deg: PerParticle
    longitude_deg: PerParticle
    altitude_m: PerParticle
    radius_m: PerParticle
    extinction_area_m2: PerParticle
    velocity_m_s: Float[np.ndarray, "particles 3"]
    birth_s: PerParticle
    death_s: PerParticle
    ice_share: PerParticle

    def __len__(self) -> int:
        return len(self.altitude_m)

    def __getitem__(self, index) -> "CloudParticles":
        """Select some of them."""
        return CloudParticles(*(getattr(self, f.name)[index] for f in fields(self)))

    @property
    def opacity(self) -> PerParticle:
        """Give what each takes from the light through its disc, from 0 to 1."""
        return -np.expm1(-self.extinction_area_m2 / (np.pi * self.radius_m**2))

    @property
    def deviation_m(self) -> PerParticle:
        """Give the standard deviation of a Gaussian as wide as the sphere, R/√5."""
        return self.radius_m / np.sqrt(5)

    def alive(self, seconds: float) -> "CloudParticles":
        """Return those that live at a time."""
        return self[(self.birth_s <= seconds) & (seconds < self.death_s)]

    def later(self, seconds: float) -> "CloudParticles":
        """Return those that live then, with lives on a clock that starts then."""
        some = self.alive(seconds)
        lives = some.birth_s - seconds, some.death_s - seconds
        return replace(some, birth_s=lives[0], death_s=lives[1])

    def joined(self, others: "CloudParticles") -> "CloudParticles":
        """Return both together."""
        return CloudParticles(
            *(
                np.concatenate([getattr(self, f.name), getattr(others, f.name)])
                for f in fields(self)
            )
        )

    def position_m(self) -> Float[np.ndarray, "particles 3"]:
        """Return the middles, ECEF."""
        return ecef(self.latitude_deg, self.longitude_deg, self.altitude_m)

    def moved(self, way_m: Float[np.ndarray, "particles 3"]) -> "CloudParticles":
        """Return them after ways to the east and north along the ground, and upwards.

        The ways follow great circles.
        """
        λ = np.radians(self.longitude_deg)
        vertical = up(self.latitude_deg, self.longitude_deg)
        none = np.zeros_like(λ)
        east = np.stack([-np.sin(λ), np.cos(λ), none], axis=-1)
        north = np.cross(vertical, east)
        level = way_m[:, :1] * east + way_m[:, 1:2] * north
        far = np.linalg.norm(level, axis=-1, keepdims=True)
        arc = far / (MEAN_RADIUS_M + self.altitude_m[:, None])
        ahead = level / np.maximum(far, 1e-9)
        there = np.cos(arc) * vertical + np.sin(arc) * ahead
        return replace(
            self,
            latitude_deg=np.degrees(np.arcsin(np.clip(there[:, 2], -1, 1))),
            longitude_deg=np.degrees(np.arctan2(there[:, 1], there[:, 0])),
            altitude_m=self.altitude_m + way_m[:, 2],
        )
