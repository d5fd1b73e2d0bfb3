"""Particles are placed where the columns of a model have optical depth.

Particle systems of clouds draw a column at random and keep it where a second draw says
so; that is `Acceptance`. `Systematic` goes through the whole of the optical depth in
equal strides instead: it refuses none, and no column is off by more than a particle.
"""

import abc
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from cloudjax.geometry.column_grid import ColumnGrid

from .cloud_particles import CloudParticles


@dataclass(frozen=True, eq=False)
class DepthColumns:
    """`DepthColumns` say how much cloud a model's columns have, level by level.

    **Fields:**

    - `grid`: where the columns are.
    - `heights_m`: of the levels' ends, ascending.
    - `depth`: optical depth of each level.
    - `velocity_m_s`: of the air, to the east, to the north and upwards; None for none.
    - `ice_share`: how much of the depth is of ice; None for none of it.
    """

    grid: ColumnGrid
    heights_m: Float[np.ndarray, "ends y x"]
    depth: Float[np.ndarray, "levels y x"]
    velocity_m_s: Float[np.ndarray, "3 levels y x"] | None = None
    ice_share: Float[np.ndarray, "levels y x"] | None = None

    @property
    def column_depth(self) -> Float[np.ndarray, "y x"]:
        """Give the optical depth of each column."""
        return self.depth.sum(axis=0)

    def extinction_area_m2(self) -> float:
        """Return the sum over columns of optical depth times area."""
        return float((self.column_depth * self.grid.area_m2()).sum())


@dataclass(frozen=True, eq=False)
class Draw:
    """A `Draw` says in which cells particles stand.

    **Fields:**

    - `level`, `row`, `column`: of the cell.
    - `rise`: where between its lower and upper end, 0 to 1.
    - `weight`: share of the whole optical depth, relative to the others.
    """

    level: Int[np.ndarray, " particles"]
    row: Int[np.ndarray, " particles"]
    column: Int[np.ndarray, " particles"]
    rise: Float[np.ndarray, " particles"]
    weight: Float[np.ndarray, " particles"]


class AbstractSampler(abc.ABC):
    """A sampler chooses cells for particles by their optical depth."""

    @abc.abstractmethod
    def draw(self, columns: DepthColumns, count: int, rng: np.random.Generator) -> Draw:
        """Choose the cells of so many particles."""


@dataclass(frozen=True)
class Systematic(AbstractSampler):
    """A `Systematic` sampler takes equal strides through the sum of optical depth."""

    def draw(self, columns: DepthColumns, count: int, rng: np.random.Generator) -> Draw:
        """Choose the cells of so many particles."""
        area = columns.grid.area_m2()
        # Columns are gone through one by one, upwards.
        cells = np.moveaxis(columns.depth * area, 0, -1)
        ends = np.cumsum(cells)
        at = (rng.uniform() + np.arange(count)) * (ends[-1] / count)
        cell = np.minimum(np.searchsorted(ends, at, side="right"), cells.size - 1)
        # Rounding may lead into a cell without cloud at the very end.
        cell = np.minimum(cell, np.flatnonzero(cells)[-1])
        held = cells.reshape(-1)[cell]
        rise = np.clip(1 - (ends[cell] - at) / held, 0, 1)
        row, column, level = np.unravel_index(cell, cells.shape)
        return Draw(level, row, column, rise, np.ones(count))


@dataclass(frozen=True)
class Acceptance(AbstractSampler):
    """An `Acceptance` draws columns at random and keeps those where M > 0.

    M = λ K/λ_max - τ with the column's optical depth λ and τ uniform from 0 to 1: in
    proportion to λ for K up to 1; with more, thick columns are all kept alike.

    **Fields:** `k`: the constant K.

    **Raises:** `ValueError` if it is not positive.
    """

    k: float = 1.0

    def __post_init__(self):
        if not self.k > 0:
            raise ValueError(f"K = {self.k:g} keeps no particle: make it more than 0.")

    def draw(self, columns: DepthColumns, count: int, rng: np.random.Generator) -> Draw:
        """Choose the cells of so many particles."""
        depth = columns.column_depth
        chance = np.minimum(depth * self.k / depth.max(), 1).reshape(-1)
        kept: list[np.ndarray] = []
        while (missing := count - sum(map(len, kept))) > 0:
            # Some more than needed, for most are refused.
            tries = int(missing / chance.mean() * 1.1) + 16
            index = rng.integers(depth.size, size=min(tries, 1 << 22))
            kept.append(index[chance[index] > rng.uniform(size=len(index))][:missing])
        row, column = cell_of(np.concatenate(kept), depth.shape[1])
        profile = np.cumsum(columns.depth[:, row, column], axis=0)
        at = rng.uniform(size=count) * profile[-1]
        level = (profile <= at).sum(axis=0)
        held = columns.depth[level, row, column]
        rise = np.clip(1 - (profile[level, np.arange(count)] - at) / held, 0, 1)
        return Draw(level, row, column, rise, columns.grid.area_m2()[row, column])


def cell_of(
    index: Int[np.ndarray, "*n"], columns: int
) -> tuple[Int[np.ndarray, "*n"], Int[np.ndarray, "*n"]]:
    """Return row and column of places in a flattened grid: floor and rest of i/COLS."""
    return index // columns, index % columns


def place(
    columns: DepthColumns,
    count: int,
    *,
    sampler: AbstractSampler | None = None,
    seed: int = 0,
) -> CloudParticles:
    """Place particles in the cloud of columns.

    They stand anywhere within their cell, and their areas add up to those of the
    columns. A particle's sphere is the part of the cell's cloud that it stands for.

    **Arguments:** `sampler`: by default `Systematic`.

    **Raises:** `ValueError` for less than one particle, and without any cloud.
    """
    if count < 1:
        raise ValueError(f"{count} particles are none: make it 1 or more.")
    whole = columns.extinction_area_m2()
    if not whole > 0:
        raise ValueError("The columns have no cloud: there is no place for particles.")
    rng = np.random.default_rng(seed)
    drawn = (sampler or Systematic()).draw(columns, count, rng)
    cell = drawn.level, drawn.row, drawn.column
    low, high = columns.heights_m[cell], columns.heights_m[(cell[0] + 1, *cell[1:])]
    jitter = rng.uniform(-0.5, 0.5, (2, count))
    latitude, longitude = columns.grid.places(*(np.stack(cell[1:]) + jitter))
    area = whole * drawn.weight / drawn.weight.sum()
    per_m = columns.depth[cell] / (high - low)
    velocity, ice = columns.velocity_m_s, columns.ice_share
    return CloudParticles(
        latitude_deg=latitude,
        longitude_deg=longitude,
        altitude_m=low + drawn.rise * (high - low),
        radius_m=np.cbrt(3 * area / (4 * np.pi * per_m)),
        extinction_area_m2=area,
        velocity_m_s=np.zeros((count, 3))
        if velocity is None
        else velocity[(slice(None), *cell)].T,
        birth_s=np.full(count, -np.inf),
        death_s=np.full(count, np.inf),
        ice_share=np.zeros(count) if ice is None else ice[cell],
    )
