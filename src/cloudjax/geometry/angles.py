"""Vectors are turned into latitudes and longitudes, fast enough for every step of an
integration.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .latlon_grid import AnyArray


def latitude_longitude_deg(
    points: Float[AnyArray, "*points 3"],
) -> tuple[Float[AnyArray, "*points"], Float[AnyArray, "*points"]]:
    """Return the geocentric latitude and longitude [degrees] of vectors of any length
    but zero.

    At a pole the longitude is 0 and its derivatives are 0, not NaN.
    """
    return angles_deg(points[..., 0], points[..., 1], points[..., 2])


def angles_deg(
    x: Float[AnyArray, "*points"],
    y: Float[AnyArray, "*points"],
    z: Float[AnyArray, "*points"],
) -> tuple[Float[AnyArray, "*points"], Float[AnyArray, "*points"]]:
    """Do what `latitude_longitude_deg` does, for vectors given as three components."""
    xp, angle = (np, np.arctan2) if isinstance(x, np.ndarray) else (jnp, arctan2)
    square = x * x + y * y
    off_pole = square > 1e-30
    rho = xp.where(off_pole, xp.sqrt(xp.where(off_pole, square, 1.0)), 0.0)
    longitude = angle(xp.where(off_pole, y, 0.0), xp.where(off_pole, x, 1.0))
    return xp.rad2deg(angle(z, rho)), xp.rad2deg(longitude)


@jax.custom_jvp
def arctan2(y: Float[Array, "*n"], x: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Return the angle [radians] of the vector (x, y), within 4e-7 in float32.

    XLA's own takes fourteen times as long on a CPU; other precisions still get it.
    """
    if jnp.result_type(y, x) != jnp.float32:
        return jnp.arctan2(y, x)
    steep = jnp.abs(y) > jnp.abs(x)
    low, high = jnp.where(steep, x, y), jnp.where(steep, y, x)
    t = jnp.abs(low) / jnp.maximum(jnp.abs(high), 1e-30)
    total = jnp.full_like(t, _ARCTAN[-1])
    for coefficient in _ARCTAN[-2::-1]:
        total = total * (t * t) + coefficient
    angle = t * total
    angle = jnp.where(steep, np.pi / 2 - angle, angle)
    angle = jnp.where(x < 0, np.pi - angle, angle)
    return jnp.where(y < 0, -angle, angle)


@arctan2.defjvp
def _arctan2_jvp(primals, tangents):
    # Of the function, not of the polynomial, whose parts have kinks.
    (y, x), (dy, dx) = primals, tangents
    return arctan2(y, x), (x * dy - y * dx) / (x * x + y * y)


def _arctan_coefficients(count: int = 8) -> list[float]:
    """Of arctan(t) = t (c₀ + c₁ t² + ...) on [0, 1], by least squares."""
    t = (np.cos(np.pi * (np.arange(4000) + 0.5) / 4000) + 1) / 2
    powers = t[:, None] ** (2 * np.arange(count))
    return np.linalg.lstsq(powers, np.arctan(t) / t, rcond=None)[0].tolist()


_ARCTAN = _arctan_coefficients()
