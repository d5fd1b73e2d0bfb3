"""A ray meets one cloud before another, where shells may overlap.

Layers are marched apart, each over its own sub-pixel structures, which are independent
of those of the others: so the mean transmittance of one is what dims another. How much
of it lies in front of a point follows from distances alone, whatever side the ray comes
from.
"""

import abc

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from cloudjax.geometry.shells import Shell

from .alike import Met, if_met


class Stretch(eqx.Module):
    """A `Stretch` is the part of each ray that lies in one shell.

    **Fields:** `start_m`, `length_m`: where it begins, on a scale that all stretches of
    a ray share, and how long it is.
    """

    start_m: Float[Array, " rays"]
    length_m: Float[Array, " rays"]


class AbstractPlace(eqx.Module):
    """A place says where on another stretch's profile points of a ray lie."""

    @abc.abstractmethod
    def read(self, profile: Float[Array, "rays nodes"]) -> Float[Array, "rays points"]:
        """Read a profile of the stretch, from start to end, linear between nodes."""

    def through(
        self, profile: Float[Array, "rays nodes"], met: Met
    ) -> Float[Array, "rays points"]:
        """Read a transmittance, which is 1 everywhere where no cloud is `met`."""
        del met
        return self.read(profile)


class Apart(AbstractPlace):
    """`Apart` are all points of a ray on one side of the other stretch.

    **Fields:** `behind`: it, and not before.
    """

    behind: Bool[Array, "rays 1"]

    def read(self, profile: Float[Array, "rays nodes"]) -> Float[Array, "rays 1"]:
        """Read the same at all points."""
        return jnp.where(self.behind, profile[:, -1:], profile[:, :1])


class Within(AbstractPlace):
    """`Within` are points anywhere on the other stretch, or beside it.

    **Fields:** `at`: in steps from the start of the stretch.
    """

    at: Float[Array, "rays points"]

    def read(self, profile: Float[Array, "rays nodes"]) -> Float[Array, "rays points"]:
        """Read a profile of the stretch, from start to end, linear between nodes."""
        index = jnp.minimum(jnp.floor(self.at), profile.shape[1] - 2).astype(jnp.int32)
        before = jnp.take_along_axis(profile, index, axis=1)
        after = jnp.take_along_axis(profile, index + 1, axis=1)
        return before + (self.at - index) * (after - before)

    def through(
        self, profile: Float[Array, "rays nodes"], met: Met
    ) -> Float[Array, "rays points"]:
        """Read a transmittance, which is 1 everywhere where no cloud is `met`."""
        return if_met(met, lambda where, some: where.read(some), 1.0, self, profile)


def overlap(one: Shell, other: Shell) -> bool:
    """Tell whether two shells have air in common."""
    return one.bottom_m < other.top_m and other.bottom_m < one.top_m


def place(
    stretch: Stretch,
    steps: int,
    own: Stretch,
    distance_m: Float[Array, "rays points"],
    *,
    overlapping: bool,
) -> AbstractPlace:
    """Find where points at distances within their own stretch lie on another one.

    Stretches of shells that do not overlap lie wholly before or behind each other.
    """
    if not overlapping:
        return Apart((own.start_m > stretch.start_m)[:, None])
    ahead = (own.start_m - stretch.start_m)[:, None] + distance_m
    at = ahead / jnp.maximum(stretch.length_m, 1e-3)[:, None] * steps
    # XLA would find it anew for the node and for how far beyond, and round the two
    # differently: at a node that is a step off.
    return Within(jax.lax.optimization_barrier(jnp.clip(at, 0, steps)))
