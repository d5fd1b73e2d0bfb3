"""Air of another longitude has the same winds and other noise."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from cloudjax.geometry.latlon_grid import AnyArray, Scalar

from .advection import DisplacementMap


class TurnedMap(DisplacementMap):
    """A `TurnedMap` is a displacement map that ends at other longitudes.

    About its axis the Earth is the same all around: what is read there is as good, and
    independent of what is read here.

    **Fields:** `turn_rad`: eastward.
    """

    turn_rad: Float[Array, ""]

    @staticmethod
    def of(one: DisplacementMap, turn_rad: Scalar) -> "TurnedMap":
        """Turn a map; by an angle of 0 it is what it was."""
        turn = jnp.asarray(turn_rad, float)
        return TurnedMap(one.displacement, one.time_s, one.duration_s, one.grid, turn)

    def displacement_of(
        self, points: Float[AnyArray, "*points 3"]
    ) -> Float[AnyArray, "*points 3"]:
        """Return where the air at these unit vectors is read, less the points."""
        moved = super().displacement_of(points)
        after = jnp.asarray(points) + moved
        sine, less = jnp.sin(self.turn_rad), 2 * jnp.sin(self.turn_rad / 2) ** 2
        x, y = after[..., 0], after[..., 1]
        turned = [-less * x - sine * y, sine * x - less * y, jnp.zeros_like(x)]
        return moved + jnp.stack(turned, axis=-1)
