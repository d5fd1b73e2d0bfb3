"""Which cloud a ray meets first, where shells may overlap.

Layers are marched apart, each over its own sub-pixel structures, which are independent
of those of the others: so the mean transmittance of one is what dims another. How much
of it lies in front of a point follows from distances alone, whatever side the ray comes
from.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from .shell import Shell


class Stretch(eqx.Module):
    """The part of each ray that lies in one shell.

    **Fields:** `start_m`, `length_m`: where it begins, on a scale that all stretches of
    a ray share, and how long it is.
    """

    start_m: Float[Array, " rays"]
    length_m: Float[Array, " rays"]


class Place(eqx.Module):
    """Where on another stretch's profile points of a ray lie.

    **Fields:** `index`, `weight`: of the node before, and of the one after it.
    """

    index: Int[Array, "rays points"]
    weight: Float[Array, "rays points"]

    def read(self, profile: Float[Array, "rays nodes"]) -> Float[Array, "rays points"]:
        """A profile from the start to the end of the stretch, linear between nodes."""
        before = jnp.take_along_axis(profile, self.index, axis=1)
        after = jnp.take_along_axis(profile, self.index + 1, axis=1)
        return before + self.weight * (after - before)


def overlap(one: Shell, other: Shell) -> bool:
    return one.bottom_m < other.top_m and other.bottom_m < one.top_m


def place(
    stretch: Stretch,
    steps: int,
    own: Stretch,
    distance_m: Float[Array, "rays points"],
    *,
    overlapping: bool,
) -> Place:
    """Where points at distances within their own stretch lie on another one.

    Stretches of shells that do not overlap lie wholly before or behind each other.
    """
    if not overlapping:
        behind = (own.start_m > stretch.start_m)[:, None]
        return Place(jnp.where(behind, steps - 1, 0), jnp.where(behind, 1.0, 0.0))
    ahead = (own.start_m - stretch.start_m)[:, None] + distance_m
    at = ahead / jnp.maximum(stretch.length_m, 1e-3)[:, None] * steps
    at = jnp.clip(at, 0, steps)
    index = jnp.minimum(jnp.floor(at), steps - 1).astype(jnp.int32)
    return Place(index, at - index)
