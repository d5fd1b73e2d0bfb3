"""Particles of a model's clouds at any moment between its times."""

import functools as ft
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime, timedelta

import numpy as np

from cloudjax.geometry.column_grid import ColumnGrid
from cloudjax.particles.cloud_particles import CloudParticles
from cloudjax.particles.motion import ColumnWinds, carried, succeeding
from cloudjax.particles.placement import AbstractSampler, place
from cloudjax_data import DataError, WrfColumns, WrfRun, read_wrf

from .model_columns import depth_columns


# Winds carry particles in steps of at most this.
_STEP_S = 300.0
_SAID = "%Y-%m-%d %H:%M"


@dataclass(frozen=True)
class ParticleSeries:
    """A `ParticleSeries` has the particles of a run at moments between its times.

    From one time of the model to the next those of the former drift with the winds and
    die one by one, while those of the latter, which come from upwind, are born.

    **Fields:**

    - `run`: the model's times.
    - `count`: of particles at a time of the model.
    - `sampler`: by which they are placed.
    - `seed`: of places and lives.
    - `centre`: of an ideal run.

    **Raises:** `DataError` for less than one particle.
    """

    run: WrfRun
    count: int
    sampler: AbstractSampler | None = None
    seed: int = 0
    centre: tuple[float, float] | None = None

    def __post_init__(self):
        if self.count < 1:
            raise DataError(f"{self.count} particles are none: give -n 1 or more.")

    def frames(
        self, start: datetime, count: int, minutes: float
    ) -> Iterator[tuple[datetime, CloudParticles]]:
        """Yield moments and the particles that live then.

        **Raises:** `DataError` for a moment outside the run, before any is yielded.
        """
        moments = [start + timedelta(minutes=i * minutes) for i in range(count)]
        first, last = self.run.times[0], self.run.times[-1]
        for moment in (moments[0], moments[-1]):
            if not first <= moment <= last:
                raise DataError(
                    f"{self.run.frames[0].path} and what else is given are of "
                    f"{first.strftime(_SAID)} to {last.strftime(_SAID)} UTC, which "
                    f"{moment.strftime(_SAID)} is not within: choose other frames."
                )
        for moment in moments:
            yield moment, self.at(moment)

    def at(self, moment: datetime) -> CloudParticles:
        """Return the particles that live at a moment of the run."""
        times = self.run.times
        if len(times) == 1:
            return _placed(self, 0)
        earlier = sum(time <= moment for time in times) - 1
        at = min(earlier, len(times) - 2)
        since = (moment - times[at]).total_seconds()
        whole = (times[at + 1] - times[at]).total_seconds()
        before, after = (part.later(since) for part in _lives(self, at))
        return self._carried(before, at, 0.0, since).joined(
            self._carried(after, at, whole, since - whole)
        )

    def _carried(
        self, some: CloudParticles, at: int, start_s: float, seconds: float
    ) -> CloudParticles:
        if not len(some) or seconds == 0:
            return some
        grid, winds = _winds(self, at)
        steps = int(np.ceil(abs(seconds) / _STEP_S))
        return carried(
            some, grid, winds, start_s=start_s, duration_s=seconds, steps=steps
        )


@ft.lru_cache(maxsize=2)
def _columns(series: ParticleSeries, at: int) -> WrfColumns:
    return read_wrf(series.run.frames[at], series.centre)


@ft.lru_cache(maxsize=2)
def _placed(series: ParticleSeries, at: int) -> CloudParticles:
    columns = depth_columns(_columns(series, at))
    seed = series.seed + at
    return place(columns, series.count, sampler=series.sampler, seed=seed)


@ft.lru_cache(maxsize=1)
def _lives(series: ParticleSeries, at: int) -> tuple[CloudParticles, CloudParticles]:
    one, other = series.run.times[at : at + 2]
    seconds = (other - one).total_seconds()
    return succeeding(
        _placed(series, at), _placed(series, at + 1), seconds, seed=series.seed
    )


@ft.lru_cache(maxsize=1)
def _winds(series: ParticleSeries, at: int) -> tuple[ColumnGrid, ColumnWinds]:
    both = [_columns(series, i) for i in (at, at + 1)]
    velocity = [columns.winds_m_s for columns in both]
    if None in velocity:
        raise DataError(
            f"{both[0].frame.path} has not all of U, V and W, without which particles "
            "do not move: ask for times of the model alone."
        )
    seconds = (both[1].time - both[0].time).total_seconds()
    return both[0].grid, ColumnWinds.of(
        both[0].grid,
        both[0].heights_m,
        np.stack([np.stack(v) for v in velocity if v is not None]),
        np.array([0.0, seconds]),
    )
