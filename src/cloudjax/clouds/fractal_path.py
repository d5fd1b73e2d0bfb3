"""The way of a ray through a fractal shell: where in the textures and masks it runs."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from cloudjax.geometry.path import Path, Profile, along_chord, on_chord


class FractalPath(eqx.Module):
    """A ray's way through a fractal shell.

    Masks and winds are found at the knots, equally far apart from the entry to the
    exit, and are linear in between.

    **Fields:**

    - `path`: the geometry.
    - `mask`: weather mask w, at the knots.
    - `texture_entry`: upwind position of the entry in periods, reduced to [0, 1).
    - `texture_change`: from the entry to each further knot, in periods.
    - `strain`: ∂x'/∂x of each texture's displacement, None without wind.
    - `reads`: points of the chord, its ends among them, between which averaged textures
      are as good as linear; None where they are not.
    - `at_steps`: whether what is read is held at every step (`Sampling`).
    """

    path: Path
    mask: Profile
    texture_entry: Float[Array, "rays textures 3"]
    texture_change: Float[Array, "rays textures 3 further"]
    strain: Float[Array, "rays textures 3 3"] | None
    reads: int | None = eqx.field(static=True, default=None)
    at_steps: bool = eqx.field(static=True, default=False)

    def position(
        self, texture: int, at: Float[np.ndarray, " points"]
    ) -> Float[Array, "3 rays points"]:
        """In a texture, in periods, at parts of the chord from 0 to 1."""
        change = jnp.moveaxis(self.texture_change[:, texture], (2, 1), (0, 1))
        ways = [jnp.zeros((3, 1, 1)), *change[..., None]]
        entry = self.texture_entry[:, texture].T
        return entry[..., None] + along_chord(ways, at)

    def branch(
        self,
        distance_m: Float[Array, " rays"],
        direction: Float[Array, "rays 3"],
        ends_m: Float[Array, "rays ends"],
        periods_m: Float[Array, " textures"],
    ) -> "FractalPath":
        """Leave the ways in another direction: see `source.py`.

        The mask and the strain stay what they are where it is left.
        """
        at = distance_m / jnp.maximum(self.path.length_m, 1.0)
        mask = on_chord(list(self.mask.values.T), jnp.clip(at, 0, 1))
        further = jnp.moveaxis(self.texture_change, -1, 0)
        knots = [jnp.zeros_like(self.texture_entry), *further]
        left = self.texture_entry + on_chord(knots, at[:, None, None])
        per_m = direction[:, None]
        if self.strain is not None:
            per_m = jnp.sum(self.strain * direction[:, None, None], axis=-1)
        per_m = jnp.broadcast_to(per_m / periods_m[None, :, None], left.shape)
        after = ends_m[:, 1:] - ends_m[:, :1]
        return FractalPath(
            path=self.path.branch(distance_m, direction, ends_m),
            mask=Profile(mask[:, None]),
            texture_entry=left + per_m * ends_m[:, :1, None],
            # The ends of the steps are the knots: positions are linear within each.
            texture_change=per_m[..., None] * after[:, None, None],
            strain=self.strain,
        )
