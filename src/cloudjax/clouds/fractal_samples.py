"""Fractal clouds keep what they sampled: rungs, and what pixels took from them."""

from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from cloudjax.geometry.path import Path, Profile, to_points
from cloudjax.weather.coarse_fields import Placed


class Reading(eqx.Module):
    """Rungs that are read at the same points, in the middle of equal parts of chords.

    **Fields:** `values`, averaged over the pixels; `rungs`: their numbers.
    """

    values: Float[Array, "rays read *axes points"]
    rungs: tuple[int, ...] = eqx.field(static=True)

    def weighted(self, amplitudes, steps: int) -> Float[Array, "rays *axes {steps}"]:
        """Sum up the rungs where they were read, which is less work than at steps."""
        # An explicit sum: a product with a weight vector, reduced, is miscompiled by
        # one release of jax (docs/decisions.md).
        total = jnp.zeros_like(self.values[:, 0])
        for place, amplitude in enumerate(amplitudes[np.array(self.rungs, int)]):
            total = total + amplitude * self.values[:, place]
        return in_steps(total, steps)


def in_steps(
    values: Float[Array, "rays *axes points"], steps: int
) -> Float[Array, "rays *axes {steps}"]:
    """Bring values from the middle of equal parts of a chord to equal steps."""
    points = values.shape[-1]
    if points == steps:
        return values
    share = jnp.asarray(to_points(steps, points).T, values.dtype)
    return jnp.matmul(values, share, precision="highest")


class FractalSamples(eqx.Module):
    """`FractalSamples` hold all that eq. (1) needs and that no fitted parameter moves.

    CF is linear in these, so a fit samples once and works on them. What changes within
    many steps only is held at few points.

    **Fields:**

    - `path`: the geometry.
    - `mask`: weather mask w.
    - `values`: of the rungs that pixels leave something of.
    - `gradients`: of the same, per metre; None where no slopes are asked.
    - `common`, `own`: variance that pixels take from each rung: of the part that all
      points of a ray within the cloud share, and of the rest.
    - `slope`: variance that they take from each component of the gradient, per metre
      squared.
    - `up`: the vertical, at points in the middle of equal parts of the chord; None
      where no slopes are asked.
    - `at`: parts of the chord, 0 to 1, at which the fractal is read once more; None
      where it is marched as it was sampled.
    - `steps`: of the march that they were made for, or points in as many equal parts.
    - `placed`: what the clouds are like there, None where that is alike everywhere.
    """

    path: Path
    mask: Profile
    values: tuple[Reading, ...]
    gradients: tuple[Reading, ...] | None
    common: Float[Array, "rays rungs"]
    own: Float[Array, "rays rungs"]
    slope: Float[Array, "rays rungs"]
    up: Float[Array, "rays 3 points"] | None
    at: Float[Array, "rays places"] | None
    steps: int = eqx.field(static=True)
    placed: Placed | None = None

    def on(self, path: Path, at: Float[Array, "rays places"]) -> "FractalSamples":
        """Read them at parts of the chord, 0 to 1, as if at another path's steps."""
        mask = Profile(self.mask.at(at))
        return replace(self, path=path, mask=mask, gradients=None, up=None, at=at)

    def within(
        self,
        first_m: Float[Array, " rays"],
        last_m: Float[Array, " rays"],
        steps: int,
    ) -> "FractalSamples":
        """Read them, and the slopes, at equal steps of a part of the ways."""
        path = self.path.part(first_m, last_m)
        whole = jnp.maximum(self.path.length_m, 1.0)

        distance = path.distance_m(steps)
        found = self.on(path, (first_m[:, None] + distance) / whole[:, None])
        if self.up is None:
            return found
        up = jnp.moveaxis(path.up(distance), 1, 0)
        return replace(found, gradients=self.gradients, up=up)

    def fractal(self, amplitudes, steps: int) -> Float[Array, "rays {steps}"]:
        """Return Σ a_o N_o in the middle of equal steps."""
        marched = steps if self.at is None else self.steps
        total = jnp.zeros((*self.path.length_m.shape, marched))
        for reading in self.values:
            total = total + reading.weighted(amplitudes, marched)
        return total if self.at is None else Profile(total).at(self.at)

    def gradient(self, amplitudes) -> Float[Array, "3 rays points"]:
        """Return Σ a_o ∇N_o, per metre."""
        assert self.up is not None
        points = self.up.shape[-1] if self.at is None else self.steps
        total = jnp.zeros((*self.up.shape[:2], points))
        for reading in self.gradients or ():
            total = total + reading.weighted(amplitudes, points)
        axes = jnp.moveaxis(total, 1, 0)
        if self.at is None:
            return axes
        return jnp.stack([Profile(axis).at(self.at) for axis in axes])


def held_alike(samples: FractalSamples, held: tuple[int, ...]) -> FractalSamples:
    """Hold every rung that any group of rays reads, at every step."""
    steps = samples.steps

    def hold(readings: tuple[Reading, ...], *axes: int) -> tuple[Reading, ...]:
        found = {
            rung: in_steps(one.values[:, place], steps)
            for one in readings
            for place, rung in enumerate(one.rungs)
        }
        none = jnp.zeros((*samples.path.length_m.shape, *axes, steps))
        every = [found.get(rung, none) for rung in held]
        return (Reading(jnp.stack(every, axis=1), held),) if held else ()

    gradients, up = samples.gradients, samples.up
    return replace(
        samples,
        values=hold(samples.values),
        gradients=None if gradients is None else hold(gradients, 3),
        up=None if up is None else in_steps(up, steps),
    )
