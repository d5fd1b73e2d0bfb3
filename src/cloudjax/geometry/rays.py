"""Lines of sight are navigated once, in float64 on the host."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float

from .arrays import HostArray
from .geodesy import GRS80, Ellipsoid, angles_of, dot, intersect, vertical


@dataclass(frozen=True)
class Rays:
    """`Rays` are the lines of sight of a sensor, one per pixel.

    **Fields:**

    - `origin_m`: where the sensor is, ECEF.
    - `direction`: unit vectors away from the sensor, ECEF.
    - `pixel_rad`: the angle that a pixel spans, from which its footprint follows.
    """

    origin_m: Float[HostArray, "rays 3"]
    direction: Float[HostArray, "rays 3"]
    pixel_rad: float | HostArray

    def __len__(self) -> int:
        return len(self.direction)

    def __getitem__(self, index) -> "Rays":
        return Rays(self.origin_m[index], self.direction[index], self.pixel_rad)

    def at(self, distance_m: Float[HostArray, " rays"]) -> Float[HostArray, "rays 3"]:
        """Return ECEF positions [m] at a distance [m] from the sensor on every ray."""
        return self.origin_m + distance_m[:, None] * self.direction

    def footprint_m(self, ellipsoid: Ellipsoid = GRS80) -> Float[np.ndarray, " rays"]:
        """Return the root of each pixel's area on the ground [m]; it is NaN off the
        Earth.
        """
        ground, hit = self.ground(ellipsoid)
        slant = -dot(ground.upward, self.direction)
        width = self.pixel_rad * ground.distance_m
        return np.where(hit, width / np.sqrt(np.where(hit, slant, 1)), np.nan)

    def ground(
        self, ellipsoid: Ellipsoid = GRS80
    ) -> tuple["GroundPoints", Bool[HostArray, " rays"]]:
        """Find where the rays first meet the ellipsoid, and which ones do.

        A ray that misses gets its point of closest approach.
        """
        near, _, hit = intersect(self.origin_m, self.direction, ellipsoid)
        upward, _ = vertical(self.at(near), ellipsoid)
        return GroundPoints(*angles_of(upward), near, upward), hit & (near > 0)


@dataclass(frozen=True)
class GroundPoints:
    """`GroundPoints` are geodetic positions on the ellipsoid.

    **Fields:**

    - `latitude_deg`, `longitude_deg`: geodetic.
    - `distance_m`: from the sensor.
    - `upward`: the geodetic verticals, unit vectors, ECEF.
    """

    latitude_deg: Float[HostArray, " rays"]
    longitude_deg: Float[HostArray, " rays"]
    distance_m: Float[HostArray, " rays"]
    upward: Float[HostArray, "rays 3"]


@runtime_checkable
class Sensor(Protocol):
    """A sensor is anything that has lines of sight: a camera, a fixed grid."""

    def rays(self) -> Rays:
        """Return the lines of sight of all pixels."""
        ...


def lines_of_sight(sight: Rays | Sensor) -> Rays:
    """Return the rays of a sensor; rays are returned as they are."""
    return sight if isinstance(sight, Rays) else sight.rays()
