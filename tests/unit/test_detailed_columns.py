"""Fractal detail below the columns of a model: the same means, and so much variance."""

import functools as ft

import jax
import numpy as np
import pytest

from cloudjax import Rays
from cloudjax.clouds.columns import ColumnCloud
from cloudjax.clouds.detailed_columns import DetailedColumns, usual_spread
from cloudjax.geometry.column_grid import ColumnGrid
from cloudjax.geometry.geodesy import ecef, up
from cloudjax.geometry.map_projections import LocalPlane
from cloudjax.geometry.shells import chords
from tests.helpers import sampling


SIDE, WIDTH_M, STEPS = 8, 10e3, 6
FIRST = -WIDTH_M * (SIDE - 1) / 2
GRID = ColumnGrid(
    LocalPlane(30.0, 40.0), (FIRST, FIRST), (WIDTH_M, WIDTH_M), (SIDE, SIDE)
)
ENDS = np.array([1000.0, 1200.0, 1500.0])[:, None, None] + np.zeros((SIDE, SIDE))
EVEN = np.full((2, SIDE, SIDE), 0.2)
COLUMNS = ColumnCloud.of(GRID, ENDS, "water", EVEN, 0 * EVEN + 10)
SPREAD = 0.5


def _rays(places: int, pixel_m: float) -> Rays:
    """Straight down on so many places each way, over the middles and between them."""
    side = np.linspace(-0.45, SIDE - 0.55, places)
    row, column = (index.ravel() for index in np.meshgrid(side, side))
    latitude, longitude = GRID.places(row, column)
    ground = ecef(latitude, longitude, np.zeros_like(latitude))
    vertical = up(latitude, longitude)
    return Rays(ground + 1e5 * vertical, -vertical, pixel_m / 98.7e3)


@jax.jit
def _found(cloud: DetailedColumns, way, textures):
    samples = cloud.sample(way, textures, steps=STEPS, slopes=False)
    found = cloud.occupancy(samples, STEPS)
    plain = cloud.columns.occupancy(samples.columns, STEPS)
    return found, plain


def _factors(seed: int, pixel_m: float, places=64) -> tuple[np.ndarray, np.ndarray]:
    """Depth of each structure over that of the columns; and the weights."""
    cloud = DetailedColumns.of(COLUMNS, 300.0, spread=SPREAD, seed=seed)
    rays = _rays(places, pixel_m)
    finest = sampling(pixel_m)
    way = cloud.navigate(rays, chords(rays, cloud.shell), finest)
    found, plain = _found(cloud, way, cloud.make_textures())
    depth = np.asarray(found.fraction, float).sum(-1)
    return depth / np.asarray(plain.fraction[0], float).sum(-1), np.asarray(
        found.weights
    )


@ft.cache
def _fine() -> np.ndarray:
    return np.stack([_mean(*_factors(seed, 50.0)) for seed in range(4)])


def _mean(factors, weights) -> np.ndarray:
    return np.tensordot(weights, factors, 1)


def test_the_mean_is_that_of_the_columns():
    """Of 64 columns, four times: within 2 %, and of each column within a tenth or so.

    The longest wave is as long as a column is wide, so that it cancels there.
    """
    fine = _fine()
    assert fine.mean() == pytest.approx(1, abs=0.02)
    columns = fine.reshape(4, SIDE, 8, SIDE, 8).mean((2, 4))
    assert columns.std() < 0.2
    assert fine.std() > 0.4


def test_what_pixels_resolve_varies_as_asked():
    """Of logarithms σ, less what 500 m of depth average: 0.5 to 0.4."""
    assert 0.8 * SPREAD < np.log(_fine()).std() < 1.02 * SPREAD


@pytest.mark.parametrize("pixel_m", [2e3, 30e3])
def test_the_mean_does_not_depend_on_the_pixel(pixel_m):
    """Over places and structures. Pixels of 30 km see no detail but in structures."""
    factors, weights = _factors(0, pixel_m)
    mean = _mean(factors, weights)
    assert mean.mean() == pytest.approx(1, abs=0.03)
    assert mean.std() < (0.02 if pixel_m == 30e3 else 0.4)
    assert np.ptp(factors, axis=0).mean() > (0.3 if pixel_m == 30e3 else 0.0)


def test_wide_columns_vary_more():
    """0.75 over the mean at 100 km (Shonk et al. 2010), 0.35 at 10 km."""
    assert np.expm1(usual_spread(100e3) ** 2) ** 0.5 == pytest.approx(0.75)
    assert np.expm1(usual_spread(10e3) ** 2) ** 0.5 == pytest.approx(0.348, abs=1e-3)
    assert usual_spread(1e6) == usual_spread(100e3)


@pytest.mark.parametrize("shortest_m", [20e3, 0.0, float("nan")])
def test_detail_is_finer_than_columns(shortest_m):
    with pytest.raises(ValueError, match="10000 m wide"):
        DetailedColumns.of(COLUMNS, shortest_m)
