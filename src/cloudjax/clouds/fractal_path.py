"""A ray's way through a fractal shell says where in the noise and masks it runs."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from cloudjax.geometry.path import Path, Profile, along_chord, on_chord
from cloudjax.weather.coarse_fields import Placed

from .ladder import EVERY_STEP


class FractalPath(eqx.Module):
    """A `FractalPath` is a ray's way through a fractal shell.

    Masks and winds are found at the knots, equally far apart from the entry to the
    exit, and are linear in between.

    **Fields:**

    - `path`: the geometry.
    - `mask`: weather mask w, at the knots.
    - `width_m`, `stretch`: of the pixel in the middle of the way, across the direction
      of view, and its length over its width.
    - `entry`: upwind position of the entry in the noise of each rung that is read, in
      periods, reduced to [0, 1).
    - `change_m`: from the entry to each further knot, upwind for each ladder; ECEF. One
      for all ladders without wind.
    - `strain`: ∂x'/∂x of each ladder's displacement, None without wind.
    - `points`: of the chord at which each rung is read, 0 where it is not.
    - `held`: rungs that are held, at every step, where groups of rays that are read
      differently are held alike; else None.
    - `placed`: what the clouds are like there, None where that is alike everywhere.
    """

    path: Path
    mask: Profile
    width_m: Float[Array, " rays"]
    stretch: Float[Array, " rays"]
    entry: Float[Array, "rays read 3"]
    change_m: Float[Array, "rays ladders 3 further"]
    strain: Float[Array, "rays ladders 3 3"] | None
    points: tuple[int, ...] = eqx.field(static=True)
    held: tuple[int, ...] | None = eqx.field(static=True, default=None)
    placed: Placed | None = None

    def positions(
        self,
        rungs: tuple[int, ...],
        ladders: tuple[int, ...],
        frames: Float[Array, "some 3 3"],
        at: Float[np.ndarray, " points"],
    ) -> Float[Array, "3 some rays points"]:
        """Return places in the noise of some rungs [periods], at parts of the chord."""
        places = np.cumsum([count > 0 for count in self.points]) - 1
        entry = jnp.moveaxis(self.entry[:, places[np.array(rungs)]], -1, 0)
        change = jnp.moveaxis(self.change_m, (3, 2), (0, 1))
        none = jnp.zeros((*change.shape[1:], 1), change.dtype)
        moved = along_chord([none, *change[..., None]], at)
        if self.change_m.shape[1] > 1:
            moved = moved[:, :, np.array(ladders)]
        return jnp.swapaxes(entry, 1, 2)[..., None] + turned(
            frames, jnp.swapaxes(moved, 1, 2)
        )

    def branch(
        self,
        distance_m: Float[Array, " rays"],
        direction: Float[Array, "rays 3"],
        ends_m: Float[Array, "rays ends"],
        frames: Float[Array, "read 3 3"],
        ladder_of: tuple[int, ...],
    ) -> "FractalPath":
        """Leave the ways in another direction: see `source.py`.

        The mask is held where it is left; strain, pixel and fields stay as they are.

        **Arguments:** `frames`, `ladder_of`: of the rungs that are read.
        """
        at = distance_m / jnp.maximum(self.path.length_m, 1.0)
        mask = on_chord(list(self.mask.values.T), jnp.clip(at, 0, 1))
        further = jnp.moveaxis(self.change_m, -1, 0)
        left_m = on_chord([jnp.zeros_like(further[0]), *further], at[:, None, None])
        upwind = direction[:, None]
        if self.strain is not None:
            upwind = jnp.sum(self.strain * direction[:, None, None], axis=-1)
        upwind = jnp.broadcast_to(upwind, left_m.shape)
        start_m = left_m + upwind * ends_m[:, :1, None]
        after = ends_m[:, 1:] - ends_m[:, :1]
        many = start_m.shape[1] > 1
        moved = [
            jnp.einsum("ab,rb->ra", frame, start_m[:, ladder if many else 0])
            for frame, ladder in zip(frames, ladder_of, strict=True)
        ]
        return FractalPath(
            path=self.path.branch(distance_m, direction, ends_m),
            mask=Profile(mask[:, None]),
            width_m=self.width_m,
            stretch=self.stretch,
            entry=self.entry + jnp.stack(moved, axis=1) if moved else self.entry,
            # The ends of the steps are the knots: positions are linear within each.
            change_m=upwind[..., None] * after[:, None, None],
            strain=self.strain,
            points=tuple(EVERY_STEP * (count > 0) for count in self.points),
            held=self.held,
            placed=self.placed,
        )

    def drawn(
        self, ladders: tuple[int, ...], gradient: Float[Array, "rays some 3 points"]
    ) -> Float[Array, "rays some 3 points"]:
        """Bring gradients from where the air came from to where it is."""
        if self.strain is None:
            return gradient
        strain = self.strain[:, np.array(ladders)]
        return jnp.einsum("roka,rokp->roap", strain, gradient, precision="highest")

    def stretched(self, ladders: tuple[int, ...]) -> Float[Array, "some #rays"]:
        """Return by how much the wind has raised the square of a gradient."""
        if self.strain is None:
            return jnp.ones((len(ladders), 1))
        square = jnp.sum(self.strain**2, axis=(2, 3)) / 3
        return square[:, np.array(ladders)].T


def turned(
    frames: Float[Array, "some 3 3"], vectors: Float[Array, "3 #some rays points"]
) -> Float[Array, "3 some rays points"]:
    """Multiply the vectors of each rung by its matrix, in one pass over the points."""
    x, y, z = vectors
    rows = [frames[:, a, :, None, None] for a in range(3)]
    return jnp.stack([row[:, 0] * x + row[:, 1] * y + row[:, 2] * z for row in rows])
