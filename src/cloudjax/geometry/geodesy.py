"""The Earth is an ellipsoid here, in float64 on the host.

Planetary coordinates lose metres in float32, so everything here is done in float64,
once per image, and hands small local numbers to the device (see `path.py`): by numpy,
or compiled for many rays (see `on_host.py`).
Vectors are Earth-centred and Earth-fixed (ECEF): x to latitude 0 longitude 0, z to
the north pole, in metres.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from .arrays import HostArray, namespace


@dataclass(frozen=True)
class Ellipsoid:
    """An `Ellipsoid` is oblate and round its axis.

    **Fields:** `semi_major_m`, `semi_minor_m`.
    """

    semi_major_m: float
    semi_minor_m: float

    @property
    def eccentricity_squared(self) -> float:
        """Give e² = 1 - (b/a)²."""
        return 1 - (self.semi_minor_m / self.semi_major_m) ** 2

    def raised(self, altitude_m: float) -> "Ellipsoid":
        """Return the surface at a geodetic altitude [m].

        That surface is not exactly an ellipsoid: raising both axes errs by an eighth of
        the square of the flattening times the altitude at most, 1.4 cm at 10 km.
        """
        return Ellipsoid(self.semi_major_m + altitude_m, self.semi_minor_m + altitude_m)


# GRS 80, the ellipsoid of the ABI fixed grid (GOES-R PUG volume 3, table 5.1.2.8).
GRS80 = Ellipsoid(6378137.0, 6356752.31414)
# Where a sphere serves: (2a + b)/3 of the ellipsoid, which is 9 m more.
MEAN_RADIUS_M = 6_371_000.0


def dot(
    one: Float[HostArray, "*#n 3"], other: Float[HostArray, "*#n 3"]
) -> Float[HostArray, "*n"]:
    """Return the scalar product of vectors of three components."""
    # A sum over so short an axis takes three times as long.
    return namespace(one).einsum("...i,...i->...", one, other)


def up(
    latitude_deg: Float[HostArray, "*n"], longitude_deg: Float[HostArray, "*n"]
) -> Float[HostArray, "*n 3"]:
    """Return the unit normal of the ellipsoid (the geodetic vertical), ECEF."""
    xp = namespace(latitude_deg)
    φ, λ = xp.radians(latitude_deg), xp.radians(longitude_deg)
    level = xp.cos(φ)
    return xp.stack([level * xp.cos(λ), level * xp.sin(λ), xp.sin(φ)], axis=-1)


def east_north_up(
    latitude_deg: float, longitude_deg: float
) -> Float[np.ndarray, "3 3"]:
    """Return the local unit vectors as rows, ECEF; at a pole north is along the
    meridian.
    """
    φ, λ = np.radians([latitude_deg, longitude_deg])
    return np.array(
        [
            [-np.sin(λ), np.cos(λ), 0.0],
            [-np.sin(φ) * np.cos(λ), -np.sin(φ) * np.sin(λ), np.cos(φ)],
            [np.cos(φ) * np.cos(λ), np.cos(φ) * np.sin(λ), np.sin(φ)],
        ]
    )


def ecef(
    latitude_deg: Float[HostArray, "*n"],
    longitude_deg: Float[HostArray, "*n"],
    altitude_m: Float[HostArray, "*n"],
    ellipsoid: Ellipsoid = GRS80,
) -> Float[HostArray, "*n 3"]:
    """Return the position [m], ECEF, at geodetic latitude, longitude and altitude."""
    normal = up(latitude_deg, longitude_deg)
    e2 = ellipsoid.eccentricity_squared
    xp = namespace(normal)
    prime_vertical = ellipsoid.semi_major_m / xp.sqrt(1 - e2 * normal[..., 2] ** 2)
    axes = np.array([1.0, 1.0, 1 - e2]).reshape((1,) * (normal.ndim - 1) + (3,))
    return (prime_vertical[..., None] * axes + altitude_m[..., None]) * normal


def geodetic(
    position_m: Float[HostArray, "*n 3"], ellipsoid: Ellipsoid = GRS80
) -> tuple[Float[HostArray, "*n"], Float[HostArray, "*n"], Float[HostArray, "*n"]]:
    """Return geodetic latitude and longitude [degrees] and altitude [m] of positions.

    It takes Bowring's iteration (Survey Review 23, 1976), whose two rounds leave less
    than a micrometre from the ground up to geostationary distance.
    """
    xp = namespace(position_m)
    sin_φ, cos_φ, altitude = _latitude(position_m, ellipsoid, rounds=2)
    return (
        xp.degrees(xp.arctan2(sin_φ, cos_φ)),
        xp.degrees(xp.arctan2(position_m[..., 1], position_m[..., 0])),
        altitude,
    )


def vertical(
    position_m: Float[HostArray, "*n 3"], ellipsoid: Ellipsoid = GRS80
) -> tuple[Float[HostArray, "*n 3"], Float[HostArray, "*n"]]:
    """Return the upward unit vector and the altitude [m] of positions in the air,
    without any angle.

    One round of Bowring's leaves 2e-11 radians and less than a micrometre up to 100 km.
    """
    xp = namespace(position_m)
    x, y, _ = xp.moveaxis(position_m, -1, 0)
    sin_φ, cos_φ, altitude = _latitude(position_m, ellipsoid, rounds=1)
    # On the axis, where there is no meridian, cos φ is 0.
    outward = cos_φ / xp.maximum(xp.sqrt(x**2 + y**2), 1e-9)
    return xp.stack([outward * x, outward * y, sin_φ], axis=-1), altitude


def angles_of(
    upward: Float[HostArray, "*n 3"],
) -> tuple[Float[HostArray, "*n"], Float[HostArray, "*n"]]:
    """Return the geodetic latitude and longitude [degrees] of verticals, the inverse of
    `up`.
    """
    xp = namespace(upward)
    x, y, z = xp.moveaxis(upward, -1, 0)
    latitude, longitude = xp.arctan2(z, xp.sqrt(x * x + y * y)), xp.arctan2(y, x)
    return xp.degrees(latitude), xp.degrees(longitude)


def _latitude(position_m, ellipsoid: Ellipsoid, rounds: int):
    """Sine and cosine of the geodetic latitude, and the altitude.

    Bowring's rounds with the sines and cosines themselves: a quarter of the time that
    angles take.
    """
    a, b = ellipsoid.semi_major_m, ellipsoid.semi_minor_m
    e2 = ellipsoid.eccentricity_squared
    xp = namespace(position_m)
    x, y, z = xp.moveaxis(position_m, -1, 0)
    ρ = xp.sqrt(x**2 + y**2)
    rise, run = a**2 * z, b**2 * ρ
    for _ in range(rounds):
        sin_β, cos_β = _normalised(b * rise, a * run)
        rise = z + e2 * a**2 / b * sin_β * sin_β * sin_β
        run = ρ - e2 * a * cos_β * cos_β * cos_β
    sin_β, cos_β = _normalised(b * rise, a * run)
    sin_φ, cos_φ = _normalised(rise, run)
    # Along the normal, which is safe at the poles and at the equator alike.
    altitude = (ρ - a * cos_β) * cos_φ + (z - b * sin_β) * sin_φ
    return sin_φ, cos_φ, altitude


def _normalised(opposite, adjacent):
    length = namespace(opposite).sqrt(opposite * opposite + adjacent * adjacent)
    return opposite / length, adjacent / length


def curvature_radius(
    normal: Float[HostArray, "*n 3"],
    direction: Float[HostArray, "*n 3"],
    ellipsoid: Ellipsoid = GRS80,
) -> Float[HostArray, "*n"]:
    """Return the radius of curvature [m] at the ground in the vertical plane of a
    direction.

    It follows from Euler's theorem for the meridian and the prime-vertical radius. A
    vertical direction has no plane and gets their mean.
    """
    xp = namespace(normal)
    e2 = ellipsoid.eccentricity_squared
    w2 = 1 - e2 * normal[..., 2] ** 2
    prime_vertical = ellipsoid.semi_major_m / xp.sqrt(w2)
    meridian = prime_vertical * (1 - e2) / w2
    horizontal2 = 1 - xp.clip(dot(normal, direction), -1, 1) ** 2
    # The eastward part, relative to the horizontal one; both vanish at the poles.
    east = normal[..., 0] * direction[..., 1] - normal[..., 1] * direction[..., 0]
    cos_latitude2 = xp.maximum(1 - normal[..., 2] ** 2, 1e-12)
    vertical = horizontal2 < 1e-12
    sin2_azimuth = xp.where(
        vertical, 0.5, east**2 / cos_latitude2 / xp.where(vertical, 1, horizontal2)
    ).clip(0, 1)
    return 1 / ((1 - sin2_azimuth) / meridian + sin2_azimuth / prime_vertical)


def intersect(
    origin_m: Float[HostArray, "*n 3"],
    direction: Float[HostArray, "*n 3"],
    ellipsoid: Ellipsoid = GRS80,
) -> tuple[Float[HostArray, "*n"], Float[HostArray, "*n"], Bool[HostArray, "*n"]]:
    """Find the distances [m] at which lines enter and leave an ellipsoid, and whether
    they do.

    Distances may be negative (behind the origin). A line that misses has both
    distances at its point of closest approach, so that its chord is empty.
    """
    squash = np.array([1, 1, ellipsoid.semi_major_m / ellipsoid.semi_minor_m])
    squash = squash.reshape((1,) * (origin_m.ndim - 1) + (3,))
    o = origin_m * squash / ellipsoid.semi_major_m
    d = direction * squash
    d_norm2 = dot(d, d)
    closest = -dot(o, d) / d_norm2
    # |o + closest d|² is the squared miss distance: no cancellation of big squares.
    miss = o + closest[..., None] * d
    miss2 = dot(miss, miss)
    hit = miss2 < 1
    xp = namespace(origin_m)
    half = xp.sqrt(xp.where(hit, 1 - miss2, 0) / d_norm2)
    a = ellipsoid.semi_major_m
    return (closest - half) * a, (closest + half) * a, hit


def sun_over(
    latitude_deg: float, longitude_deg: float, *, zenith_deg: float, azimuth_deg: float
) -> Float[np.ndarray, "3"]:
    """Return the direction of a sun that stands so over a place: a unit vector, ECEF.

    **Arguments:** `zenith_deg`: from straight up; `azimuth_deg`: clockwise from north.
    """
    θ, α = np.radians([zenith_deg, azimuth_deg])
    east, north, vertical = east_north_up(latitude_deg, longitude_deg)
    level = np.sin(α) * east + np.cos(α) * north
    return np.cos(θ) * vertical + np.sin(θ) * level
