"""Particles move: by Newton's law from their own speed, or with a model's winds.

Between two times of a model those of the earlier one die and those of the later one are
born, so that the cloud turns from one into the other while both drift.
"""

import functools as ft
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from cloudjax.geometry.column_grid import ColumnGrid
from cloudjax.geometry.geodesy import Ellipsoid, east_north_up
from cloudjax.geometry.map_projections import MODEL_RADIUS_M
from cloudjax.weather.time_stepping import AbstractScheme, RungeKutta4

from .cloud_particles import CloudParticles


def accelerated(
    particles: CloudParticles,
    seconds: float,
    acceleration_m_s2: Float[np.ndarray, "#particles 3"] | float = 0.0,
) -> CloudParticles:
    """Move particles by S = S₀ + V₀ T + a T²/2 in each component.

    **Arguments:** `acceleration_m_s2`: to the east, to the north and upwards.
    """
    a = np.broadcast_to(acceleration_m_s2, particles.velocity_m_s.shape)
    way = particles.velocity_m_s * seconds + a * (seconds**2 / 2)
    moved = particles.moved(way)
    return replace(moved, velocity_m_s=particles.velocity_m_s + a * seconds)


class ColumnWinds(eqx.Module):
    """`ColumnWinds` are the winds of a model at one time or two, linear in between.

    **Fields:**

    - `rates`: of row, column [1/s] and altitude [m/s], at each time.
    - `middles_m`: heights at which they are given.
    - `time_s`: of each time.
    """

    rates: Float[Array, "times 3 levels y x"]
    middles_m: Float[Array, "levels y x"]
    time_s: Float[Array, " times"]

    @classmethod
    def of(
        cls,
        grid: ColumnGrid,
        heights_m: Float[np.ndarray, "ends y x"],
        velocity_m_s: Float[np.ndarray, "times 3 levels y x"],
        time_s: Float[np.ndarray, " times"],
    ) -> "ColumnWinds":
        """Make them from winds to the east, to the north and upwards.

        **Arguments:** `heights_m`: of the levels' ends.
        """
        latitude, longitude = grid.places(*grid.mesh())
        frames = np.vectorize(east_north_up, signature="(),()->(a,b)")
        level = frames(latitude, longitude)[..., :2, :]
        # Metres of the model's wind are those of the model's sphere.
        sphere = Ellipsoid(MODEL_RADIUS_M, MODEL_RADIUS_M)
        per_m = np.einsum("yxkc,yxac->kayx", grid.per_m(sphere), level)
        index = np.einsum("kayx,talyx->tklyx", per_m, velocity_m_s[:, :2])
        rates = np.concatenate([index, velocity_m_s[:, 2:]], axis=1)
        middles = (heights_m[1:] + heights_m[:-1]) / 2
        arrays = (jnp.asarray(x, float) for x in (rates, middles, time_s))
        return cls(*arrays)

    def __call__(
        self, place: Float[Array, "3 particles"], time_s: Float[Array, ""]
    ) -> Float[Array, "3 particles"]:
        """Return the rates at rows, columns and altitudes; held beyond the columns."""
        corners, weights = self._corners(place)
        middles = _mean(self.middles_m, corners, weights)
        count = len(middles)
        above = jnp.sum(middles <= place[2][None], axis=0)
        low = jnp.clip(above - 1, 0, max(count - 2, 0))
        high = jnp.minimum(low + 1, count - 1)
        bottom, top = (
            jnp.take_along_axis(middles, i[None], axis=0)[0] for i in (low, high)
        )
        part = jnp.clip((place[2] - bottom) / jnp.maximum(top - bottom, 1.0), 0, 1)
        now = self._now(time_s)
        below, beyond = (
            _mean(now, [(level, *corner) for corner in corners], weights)
            for level in (low, high)
        )
        return below + part[None] * (beyond - below)

    def _now(self, time_s) -> Float[Array, "3 levels y x"]:
        if len(self.time_s) == 1:
            return self.rates[0]
        first, last = self.time_s[0], self.time_s[-1]
        part = jnp.clip((time_s - first) / (last - first), 0, 1)
        return self.rates[0] + part * (self.rates[-1] - self.rates[0])

    def _corners(self, place):
        rows, columns = self.middles_m.shape[1:]
        row = jnp.clip(place[0], 0, rows - 1)
        column = jnp.clip(place[1], 0, columns - 1)
        i = jnp.clip(jnp.floor(row), 0, rows - 2).astype(int)
        j = jnp.clip(jnp.floor(column), 0, columns - 2).astype(int)
        u, v = row - i, column - j
        corners = [(i, j), (i, j + 1), (i + 1, j), (i + 1, j + 1)]
        return corners, [(1 - u) * (1 - v), (1 - u) * v, u * (1 - v), u * v]


def _mean(values, corners, weights) -> Array:
    """The weighted mean of values at corners, which index all axes but the first."""
    parts = [
        values[(slice(None), *corner)] * weight[None]
        for corner, weight in zip(corners, weights, strict=True)
    ]
    return ft.reduce(jnp.add, parts)


# Compiled stage by stage: in one piece XLA repeats reads that stages share, and takes
# half a minute.
_rates = jax.jit(ColumnWinds.__call__)


def carried(
    particles: CloudParticles,
    grid: ColumnGrid,
    winds: ColumnWinds,
    *,
    start_s: float,
    duration_s: float,
    steps: int = 12,
    scheme: AbstractScheme | None = None,
) -> CloudParticles:
    """Carry particles with the winds of a model, in equal steps.

    **Arguments:**

    - `grid`: of the winds.
    - `start_s`, `duration_s`: from when and how long; a negative duration goes upwind.
    - `scheme`: one step; by default of Runge and Kutta.

    **Raises:** `ValueError` for no steps.
    """
    if steps < 1:
        raise ValueError(f"{steps} steps are none: make it 1 or more.")
    row, column = grid.index(particles.latitude_deg, particles.longitude_deg)
    place = jnp.asarray(np.stack([row, column, particles.altitude_m]), float)
    start = place
    step = jnp.asarray(duration_s / steps, float)
    for i in range(steps):
        time = start_s + step * i
        place = (scheme or RungeKutta4())(ft.partial(_rates, winds), place, time, step)
    # The change alone comes back, so that nothing is rounded where no wind is.
    change = np.asarray(place - start, float)
    latitude, longitude = grid.places(row + change[0], column + change[1])
    return replace(
        particles,
        latitude_deg=latitude,
        longitude_deg=longitude,
        altitude_m=particles.altitude_m + change[2],
    )


def succeeding(
    before: CloudParticles,
    after: CloudParticles,
    duration_s: float,
    seed: int = 0,
) -> tuple[CloudParticles, CloudParticles]:
    """Let the particles of one model time die while those of the next are born.

    One by one and in equal strides: of a part t of the time, 1 - t of the former and t
    of the latter live.
    """
    rng = np.random.default_rng(seed)

    def moments(count: int) -> Float[np.ndarray, " particles"]:
        strides = (rng.permutation(count) + rng.uniform()) / count
        return duration_s * strides

    return (
        replace(before, death_s=moments(len(before))),
        replace(after, birth_s=moments(len(after))),
    )
