"""Many particles are cloud of columns again: each is shared out among cells near it.

A particle is a Gaussian there, of which a cell has the part that lies within it along
the rows, along the columns and between the heights of its level. The shares of each
particle add up to one, so that no cloud is lost, at the edges either.
"""

import itertools as it
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int
from scipy.special import ndtr

from .cloud_particles import CloudParticles, PerParticle
from .placement import DepthColumns


# Standard deviations to each side that are shared out, and cells at the most.
_REACH, _MOST_CELLS = 3.0, 64
# Shares at once, of 8 bytes.
_AT_ONCE = 1 << 22


def deposited(particles: CloudParticles, columns: DepthColumns) -> DepthColumns:
    """Share particles out among the cells of columns.

    Particles whose middle is beyond the outermost cells are left out. What lies more
    than 64 cells from the middle of a wide one is given to the nearer cells.

    **Arguments:** `columns`: whose cells are filled; their own cloud is not asked.

    **Returns:** columns with the optical depth of the particles and their share of ice.
    """
    grid, levels = columns.grid, len(columns.heights_m) - 1
    # Of water, and of ice.
    found = np.zeros((2, levels, grid.shape[0] * grid.shape[1]))
    held = particles[grid.holds(particles.latitude_deg, particles.longitude_deg)]
    for some, far in _alike(held, min(map(abs, grid.spacing_m)), levels):
        cell, share = _shares(some, columns, far)
        parts = some.extinction_area_m2 * np.stack([1 - some.ice_share, some.ice_share])
        for phase, level in it.product(range(2), range(levels)):
            amount = (share[level] * parts[phase]).reshape(-1)
            found[phase, level] += np.bincount(cell, amount, found.shape[-1])
    water, ice = found.reshape(2, levels, *grid.shape) / grid.area_m2()
    depth = water + ice
    share = ice / np.where(depth > 0, depth, 1)
    return replace(columns, depth=depth, ice_share=share, velocity_m_s=None)


def _alike(
    particles: CloudParticles, spacing_m: float, levels: int
) -> Iterator[tuple[CloudParticles, int]]:
    """Yield some that reach about equally far, and how many cells."""
    cells = _REACH * particles.deviation_m / spacing_m + 0.5
    far = 2 ** np.ceil(np.log2(cells)).clip(0, np.log2(_MOST_CELLS)).astype(int)
    for reach in np.unique(far):
        some = np.flatnonzero(far == reach)
        count = max(_AT_ONCE // (levels * (2 * int(reach) + 1) ** 2), 1)
        for start in range(0, len(some), count):
            yield particles[some[start : start + count]], int(reach)


def _shares(
    particles: CloudParticles, columns: DepthColumns, far: int
) -> tuple[Int[np.ndarray, " near"], Float[np.ndarray, "levels y x particles"]]:
    """Find columns near each particle, and what their levels have of it."""
    grid = columns.grid
    place = grid.index(particles.latitude_deg, particles.longitude_deg)
    spacing = np.abs(grid.spacing_m)[::-1]
    (row, north), (column, east) = (
        _along(x, particles.deviation_m / d, n, far)
        for x, d, n in zip(place, spacing, grid.shape, strict=True)
    )
    # What is above or below all levels goes to the outermost.
    ends = columns.heights_m[:, row[:, None], column[None]]
    below = ndtr((ends - particles.altitude_m) / particles.deviation_m)
    below[0], below[-1] = 0, 1
    cell = row[:, None] * grid.shape[1] + column[None]
    return cell.reshape(-1), np.diff(below, axis=0) * (north[:, None] * east[None])


def _along(
    place: PerParticle, deviation: PerParticle, count: int, far: int
) -> tuple[Int[np.ndarray, "cells particles"], Float[np.ndarray, "cells particles"]]:
    """Find cells of an axis near places on it, and what each has; all in cells."""
    nearest = np.clip(np.rint(place), 0, count - 1).astype(int)
    cell = nearest + np.arange(-far, far + 1)[:, None]
    ends = (cell + np.array([-0.5, 0.5])[:, None, None] - place) / deviation
    share = np.diff(ndtr(ends), axis=0)[0] * ((cell >= 0) & (cell < count))
    return np.clip(cell, 0, count - 1), share / share.sum(axis=0)
