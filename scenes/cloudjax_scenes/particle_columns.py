"""Particles of a file are clouds on columns again, for the renderer."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from cloudjax.geometry.column_grid import ColumnGrid
from cloudjax.geometry.map_projections import LocalPlane
from cloudjax.light.bulk_extinction import extinction_m2_g
from cloudjax.particles.cloud_particles import CloudParticles
from cloudjax.particles.deposit import deposited
from cloudjax.particles.placement import DepthColumns
from cloudjax_data import DataError
from cloudjax_data.condensate import Condensate

from .cloud_thickness import ICE, WATER, CloudKind
from .particle_files import local_position_m
from .particle_reading import read_particles


# Cells are as wide and as deep as a usual particle's deviation, which blurs it by an
# eighth; wider where there would be more of them than these.
_MOST_COLUMNS, _MOST_LEVELS = 1 << 17, 32
# About the middles of particles, in deviations.
_REACH = 3.0
_LEAST_DEPTH = 1e-12


@dataclass(frozen=True, eq=False)
class ParticleColumns:
    """`ParticleColumns` are the clouds of particles on columns of a local map.

    Make them with `ParticleColumns.read` or `ParticleColumns.of`. The air is the US
    standard atmosphere.

    **Fields:**

    - `path`: of the file.
    - `time`: of the particles, in UTC.
    - `grid`, `heights_m`: where the columns and their levels are.
    - `condensate`: water, ice, or both.
    """

    path: Path
    time: datetime
    grid: ColumnGrid
    heights_m: Float[np.ndarray, "ends y x"]
    condensate: tuple[Condensate, ...]
    cloud_fraction: None = None
    winds_m_s: None = None
    air: None = None

    @staticmethod
    def read(
        path: str | os.PathLike[str], time: datetime | None = None
    ) -> "ParticleColumns":
        """Read a file of particles, and share them out among columns.

        **Arguments:** `time`: of the sun, in place of that of the file.

        **Raises:** `DataError` as `read_particles` does, and where neither says when.
        """
        path = Path(path)
        particles, own = read_particles(path)
        return ParticleColumns.of(particles, path, time or own)

    @staticmethod
    def of(
        particles: CloudParticles, path: Path, time: datetime | None
    ) -> "ParticleColumns":
        """Share particles of a file out among columns.

        **Raises:** `DataError` without a time, and for particles without cloud.
        """
        if time is None:
            raise DataError(f"{path} does not say of which time it is: give --time.")
        held = deposited(particles, columns_about(particles))
        assert held.ice_share is not None
        parts = (WATER, 1 - held.ice_share), (ICE, held.ice_share)
        condensate = tuple(
            _condensate(held, kind, share)
            for kind, share in parts
            if (held.depth * share).max() > _LEAST_DEPTH
        )
        if not condensate:
            raise DataError(f"{path} has particles without any cloud: write it again.")
        return ParticleColumns(
            path, time.astimezone(UTC), held.grid, held.heights_m, condensate
        )

    @property
    def sources(self) -> Sequence[str]:
        """Give the name of the file."""
        return (self.path.name,)

    @property
    def ground_m(self) -> Float[np.ndarray, "y x"]:
        """Give the height of the ground, sea level."""
        return np.zeros(self.grid.shape)

    def require_cloud(self) -> None:
        """Do nothing: there is cloud."""

    def cautions(self) -> list[str]:
        """Say what particles do not tell."""
        return [
            "Particles know no radius: droplets have "
            f"{WATER.effective_radius_um:g} um here, and ice "
            f"{ICE.effective_radius_um:g} um; the air is the US standard atmosphere."
        ]


def columns_about(particles: CloudParticles) -> DepthColumns:
    """Lay empty columns around particles, on a plane that touches the Earth there."""
    _, (latitude, longitude) = local_position_m(particles)
    plane = LocalPlane(latitude, longitude)
    place = np.stack(plane.project(particles.latitude_deg, particles.longitude_deg))
    usual, reach = np.median(particles.deviation_m), _REACH * particles.deviation_m
    low, high = (place - reach).min(axis=1), (place + reach).max(axis=1)
    spacing = max(float(usual), float(np.sqrt(np.prod(high - low) / _MOST_COLUMNS)))
    columns, rows = np.ceil((high - low) / spacing).astype(int) + 1
    first = float(low[0]), float(low[1])
    grid = ColumnGrid(plane, first, (spacing, spacing), (int(rows), int(columns)))
    ends = _level_ends(particles, reach)
    levels = len(ends) - 1
    heights = np.broadcast_to(ends[:, None, None], (levels + 1, *grid.shape))
    return DepthColumns(grid, heights, np.zeros((levels, *grid.shape)))


def _level_ends(
    particles: CloudParticles, reach: Float[np.ndarray, " particles"]
) -> Float[np.ndarray, " ends"]:
    """Ends of levels, about as deep as particles there deviate.

    Where no particle reaches between others, a single level is enough.
    """
    low = np.maximum(particles.altitude_m - reach, 0)
    high = np.maximum(particles.altitude_m + reach, low + 1)
    order = np.argsort(low, kind="stable")
    low, high, deviation = low[order], high[order], particles.deviation_m[order]
    top = np.maximum.accumulate(high)
    first = np.flatnonzero(np.concatenate([[True], low[1:] > top[:-1]]))
    if len(first) > _MOST_LEVELS // 2:
        first = first[:1]
    last = np.concatenate([first[1:], [len(low)]]) - 1
    usual = np.array(
        [np.median(deviation[i : j + 1]) for i, j in zip(first, last, strict=True)]
    )
    wanted = (top[last] - low[first]) / usual
    # Gaps are levels too.
    shrunk = min(1.0, (_MOST_LEVELS + 1 - len(first)) / wanted.sum())
    counts = np.maximum(np.ceil(wanted * shrunk - 1e-9), 1).astype(int)
    return np.concatenate(
        [
            np.linspace(low[i], top[j], n + 1)
            for i, j, n in zip(first, last, counts, strict=True)
        ]
    )


def _condensate(held: DepthColumns, kind: CloudKind, share) -> Condensate:
    """Water or ice of its usual radius: particles know none."""
    radius = kind.effective_radius_um
    per_gram = float(extinction_m2_g(kind.phase, jnp.asarray(radius, float)))
    per_m = held.depth * share / np.diff(held.heights_m, axis=0)
    return Condensate(kind.phase, per_m / per_gram, np.full_like(per_m, radius))
