"""Lights of particle systems fall off with the square of the distance alone.

The light of a point, added up along a line of sight: nothing takes from it on the way
and nothing is scattered, so this is a tone for viewers and a test, and no light of the
march. A more distant end always adds to it.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float


def point_light(
    intensity: Float[Array, "*rays"] | float,
    camera_m: Float[Array, "*rays 3"],
    direction: Float[Array, "*rays 3"],
    source_m: Float[Array, "*#rays 3"],
    depth_m: Float[Array, "*rays"],
) -> Float[Array, "*rays"]:
    """Integrate I/|x(t) - s|² over x(t) = c + t d, t from 0 to the depth.

    With b = d·(c - s) and the distance w of the line from the source it is
    (I/w) [atan((b + depth)/w) - atan(b/w)]; the difference of the two angles is taken
    as one, which keeps its digits far from the source.

    **Arguments:** `direction`: unit vectors; `camera_m`, `source_m`: within some
    thousand kilometres of each other, or in double precision.
    """
    away = camera_m - source_m
    along = jnp.sum(direction * away, axis=-1)
    across = jnp.linalg.norm(jnp.cross(direction, away), axis=-1)
    # On a line through the source itself the integral is 1/b - 1/(b + depth).
    across = jnp.maximum(across, 1e-6 * (jnp.abs(along) + depth_m))
    angle = jnp.arctan2(across * depth_m, across**2 + along * (along + depth_m))
    return intensity * angle / across
