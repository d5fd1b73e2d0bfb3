"""Which cloud a ray meets first, where shells may overlap.

Layers are marched apart, each over its own sub-pixel structures, which are independent
of those of the others: so the mean transmittance of one is what dims another. How much
of it lies in front of a point follows from distances alone, whatever side the ray comes
from.
"""

import abc

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from cloudjax.geometry.shells import Shell


class Stretch(eqx.Module):
    """The part of each ray that lies in one shell.

    **Fields:** `start_m`, `length_m`: where it begins, on a scale that all stretches of
    a ray share, and how long it is.
    """

    start_m: Float[Array, " rays"]
    length_m: Float[Array, " rays"]


class AbstractPlace(eqx.Module):
    """Where on another stretch's profile points of a ray lie."""

    @abc.abstractmethod
    def read(self, profile: Float[Array, "rays nodes"]) -> Float[Array, "rays points"]:
        """A profile from the start to the end of the stretch, linear between nodes."""


class Apart(AbstractPlace):
    """All points of a ray on one side of the other stretch.

    **Fields:** `behind`: it, and not before.
    """

    behind: Bool[Array, "rays 1"]

    def read(self, profile: Float[Array, "rays nodes"]) -> Float[Array, "rays 1"]:
        """The same at all points."""
        return jnp.where(self.behind, profile[:, -1:], profile[:, :1])


class Within(AbstractPlace):
    """Points anywhere.

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
) -> AbstractPlace:
    """Where points at distances within their own stretch lie on another one.

    Stretches of shells that do not overlap lie wholly before or behind each other.
    """
    if not overlapping:
        return Apart((own.start_m > stretch.start_m)[:, None])
    ahead = (own.start_m - stretch.start_m)[:, None] + distance_m
    at = ahead / jnp.maximum(stretch.length_m, 1e-3)[:, None] * steps
    at = jnp.clip(at, 0, steps)
    index = jnp.minimum(jnp.floor(at), steps - 1).astype(jnp.int32)
    return Within(index, at - index)
