"""A ray's way through a model's columns is told: which columns, and how high."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from cloudjax.geometry.path import Path, Profile


# A step that hardly rises is read over this much of the air [m]: so little that no
# level is thinner, so much that single precision tells its ends apart.
LEAST_RISE_M = 20.0


class ColumnPath(eqx.Module):
    """A `ColumnPath` is a ray's way through columns.

    **Fields:**

    - `path`: the geometry.
    - `index`: row and column at points equally far apart, from the entry to the exit.
    - `per_m`: how row and column change along ECEF vectors, in the middle.
    """

    path: Path
    index: Float[Array, "rays knots 2"]
    per_m: Float[Array, "rays 2 3"]

    def places(
        self, part: Float[Array, "rays points"]
    ) -> Float[Array, "rays 2 points"]:
        """Return row and column at parts of the way, from 0 to 1."""
        axes = [Profile(self.index[..., i], ends=True).at(part) for i in range(2)]
        return jnp.stack(axes, axis=1)

    def branch(
        self,
        distance_m: Float[Array, " rays"],
        direction: Float[Array, "rays 3"],
        ends_m: Float[Array, "rays ends"],
    ) -> "ColumnPath":
        """Leave the ways in another direction, along which the map is straight."""
        part = distance_m / jnp.maximum(self.path.length_m, 1.0)
        # Also before the entry and behind the exit, where the profile would be held.
        first, last = self.index[:, 0], self.index[:, -1]
        inside = self.places(jnp.clip(part, 0, 1)[:, None])[..., 0]
        stretch = self.index.shape[1] - 1
        before = (self.index[:, 1] - first) * (stretch * jnp.minimum(part, 0))[:, None]
        behind = jnp.maximum(part - 1, 0)
        after = (last - self.index[:, -2]) * (stretch * behind)[:, None]
        start = inside + before + after
        per_m = jnp.sum(self.per_m * direction[:, None], axis=-1)
        end = start + per_m * ends_m[:, -1:]
        return ColumnPath(
            path=self.path.branch(distance_m, direction, ends_m),
            index=jnp.stack([start, end], axis=1),
            per_m=self.per_m,
        )


class ColumnSamples(eqx.Module):
    """`ColumnSamples` say where among the columns the steps of rays are; what is there
    are parameters.

    **Fields:**

    - `path`: the geometry.
    - `index`: row and column in the middle of each step.
    - `ends_m`: altitudes of the lower and the upper end of each step.
    - `per_m`: as in `ColumnPath`; None where no normals are asked.
    """

    path: Path
    index: Float[Array, "rays 2 steps"]
    ends_m: Float[Array, "rays 2 steps"]
    per_m: Float[Array, "rays 2 3"] | None

    def on(self, path: Path, at: Float[Array, "rays points"]) -> "ColumnSamples":
        """Place them at parts of the chord, 0 to 1, as if at another path's steps."""
        index = [Profile(self.index[:, axis]).at(at) for axis in range(2)]
        ends = step_ends_m(path, at.shape[-1])
        return ColumnSamples(path, jnp.stack(index, axis=1), ends, None)


def step_ends_m(path: Path, steps: int) -> Float[Array, "rays 2 {steps}"]:
    """Return the altitudes [m] between which each step lies, some metres apart."""
    altitude = path.altitude_m(path.step_ends_m(steps))
    before, after = altitude[:, :-1], altitude[:, 1:]
    middle, half = (before + after) / 2, jnp.abs(after - before) / 2
    half = jnp.maximum(half, LEAST_RISE_M / 2)
    return jnp.stack([middle - half, middle + half], axis=1)
