"""Clouds live in shells of air between two altitudes, from which rays cut chords."""

from dataclasses import dataclass

from jaxtyping import Bool, Float

from .arrays import HostArray, namespace
from .geodesy import GRS80, Ellipsoid, intersect
from .rays import Rays


@dataclass(frozen=True)
class Shell:
    """A `Shell` is the air between two geodetic altitudes.

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

    @property
    def depth_m(self) -> float:
        """Give the difference of its altitudes."""
        return self.top_m - self.bottom_m


@dataclass(frozen=True)
class Chords:
    """`Chords` are the parts of rays that lie within a shell; they are empty where a
    ray misses.

    **Fields:** `entry_m`, `length_m`: distance of the entry from the sensor, and how
    long the ray stays.
    """

    entry_m: Float[HostArray, " rays"]
    length_m: Float[HostArray, " rays"]


def chords(rays: Rays, shell: Shell, ellipsoid: Ellipsoid = GRS80) -> Chords:
    """Find the first chord of each ray through a shell, from wherever the sensor
    stands.

    The sensor may be above, within or below the shell.
    """
    return both_chords(rays, shell, ellipsoid)[0]


def both_chords(
    rays: Rays, shell: Shell, ellipsoid: Ellipsoid = GRS80
) -> tuple[Chords, Chords]:
    """Find the first chord of each ray, and the second one of rays that graze the Earth
    and cross the shell again beyond its floor.
    """
    xp = namespace(rays.direction)
    near, far, hits = _cut(rays, ellipsoid.raised(shell.top_m))
    floor_near, floor_far, hits_floor = _cut(rays, ellipsoid.raised(shell.bottom_m))
    grounded = meets_ground(rays, ellipsoid)
    below = hits_floor & (floor_near <= 0) & (floor_far > 0)
    start = xp.where(below, floor_far, xp.maximum(near, 0))
    end = xp.where(hits_floor & (floor_near > 0), floor_near, far)
    # From below the shell, the ground hides what lies behind it.
    first = hits & ~(below & grounded)
    second = hits & hits_floor & (floor_near > 0) & ~grounded
    return (
        Chords(start, xp.where(first, xp.maximum(end - start, 0), 0)),
        Chords(floor_far, xp.where(second, xp.maximum(far - floor_far, 0), 0)),
    )


def _cut(rays: Rays, ellipsoid: Ellipsoid):
    return intersect(rays.origin_m, rays.direction, ellipsoid)


def meets_ground(rays: Rays, ellipsoid: Ellipsoid = GRS80) -> Bool[HostArray, " rays"]:
    """Tell which rays end on the ground, from wherever the sensor stands."""
    # The middle of its chord tells ahead from behind even where the sensor stands on
    # the ground.
    near, far, hits = _cut(rays, ellipsoid)
    return hits & (near + far > 0)
