"""Cloud shells: the air between two altitudes, and the chords that rays cut from it."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from .geodesy import GRS80, Ellipsoid, intersect
from .rays import Rays


@dataclass(frozen=True)
class Shell:
    """The air between two geodetic altitudes.

    **Fields:** `bottom_m`, `top_m`.
    """

    bottom_m: float
    top_m: float

    def __post_init__(self):
        if not -500 <= self.bottom_m < self.top_m <= 100e3:
            raise ValueError(
                f"A shell from {self.bottom_m} m to {self.top_m} m is not one: give a "
                "bottom below the top, both between -500 m and 100 km."
            )


@dataclass(frozen=True)
class Chords:
    """The part of each ray that lies within a shell: empty where the ray misses.

    **Fields:** `entry_m`, `length_m`: distance of the entry from the sensor, and how
    long the ray stays.
    """

    entry_m: Float[np.ndarray, " rays"]
    length_m: Float[np.ndarray, " rays"]


def chords(rays: Rays, shell: Shell, ellipsoid: Ellipsoid = GRS80) -> Chords:
    """The first chord of each ray through a shell, from wherever the sensor stands.

    The sensor may be above, within or below the shell. A ray that grazes the Earth
    crosses a hollow shell twice; its second chord, seen through the first and through
    the air below, is left out.
    """
    near, far, hits = intersect(
        rays.origin_m, rays.direction, ellipsoid.raised(shell.top_m)
    )
    floor_near, floor_far, hits_floor = intersect(
        rays.origin_m, rays.direction, ellipsoid.raised(shell.bottom_m)
    )
    ground_near, ground_far, hits_ground = intersect(
        rays.origin_m, rays.direction, ellipsoid
    )
    below = hits_floor & (floor_near <= 0) & (floor_far > 0)
    start = np.where(below, floor_far, np.maximum(near, 0))
    end = np.where(hits_floor & (floor_near > 0), floor_near, far)
    # From below the shell, the ground hides what lies behind it. The middle of its
    # chord tells ahead from behind even where the sensor stands on it.
    hidden = below & hits_ground & (ground_near + ground_far > 0)
    length = np.where(hits & ~hidden, np.maximum(end - start, 0), 0)
    return Chords(start, length)
