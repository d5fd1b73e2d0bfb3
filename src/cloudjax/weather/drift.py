"""The wind carries air from upwind positions and strains it on the way."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from cloudjax.geometry.geodesy import GRS80, Ellipsoid

from .advection import DisplacementMap


def drift_m(
    vertical: Float[Array, "*n 3"],
    altitude_m: Float[Array, "*n"],
    displacement: DisplacementMap,
    ellipsoid: Ellipsoid = GRS80,
) -> Float[Array, "*n 3"]:
    """Find the vector [m] from positions to where their air came from, at the same
    altitude (Schinder et al. 2024, section 2.2).

    Schinder et al. 2024, section 2.2.

    ECEF, on the device: with n the vertical, N the prime-vertical radius and
    E = diag(1, 1, 1-e²), x = (N E + z) n. The difference of two such is formed from
    n' - n, so that float32 loses a part in 10⁷ of the drift and not of the Earth.

    **Arguments:**

    - `vertical`: geodetic, unit vectors.
    - `displacement`: a displacement map.
    """
    moved = displacement.displacement_of(vertical)
    after = vertical + moved
    e2, a = ellipsoid.eccentricity_squared, ellipsoid.semi_major_m
    root = jnp.sqrt(1 - e2 * vertical[..., 2] ** 2)
    root_after = jnp.sqrt(1 - e2 * after[..., 2] ** 2)
    # N' - N from the difference of the squares under the roots.
    squares = e2 * moved[..., 2] * (after[..., 2] + vertical[..., 2])
    swelling = a * squares / (root * root_after * (root + root_after))
    squash = jnp.asarray([1.0, 1.0, 1 - e2]).reshape((1,) * (moved.ndim - 1) + (3,))
    level = (a / root_after)[..., None] * moved + swelling[..., None] * vertical
    return level * squash + altitude_m[..., None] * moved


def strain(
    vertical: Float[Array, "rays 3"],
    displacement: DisplacementMap,
    ellipsoid: Ellipsoid = GRS80,
) -> Float[Array, "rays 3 3"]:
    """Find ∂x'/∂x of the drift, by the derivative of the interpolated map."""

    def one(n):
        # Twice as far from the centre, air drifts twice as far.
        r = jnp.linalg.norm(n)
        return r * drift_m(n / r, jnp.zeros(()), displacement, ellipsoid)

    gradient = jax.vmap(jax.jacfwd(one))(vertical) / ellipsoid.semi_major_m
    return jnp.eye(3)[None] + gradient
