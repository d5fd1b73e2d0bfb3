"""Geometry compiled for many rays against the same functions in numpy."""

import jax
import numpy as np
import pytest

from cloudjax import LatLonGrid, ProfileGrid, Rays, Shell
from cloudjax.air.clear_air import Air
from cloudjax.air.gases import LEVELS_M
from cloudjax.clouds.columns import ColumnCloud
from cloudjax.geometry.column_grid import ColumnGrid
from cloudjax.geometry.footprint import Sampling, kinds
from cloudjax.geometry.geostationary_map import GeostationaryMap
from cloudjax.geometry.map_projections import (
    ConformalConic,
    LatLonMap,
    LocalPlane,
    Mercator,
)
from cloudjax.geometry.path import find_chords, ground_points, navigate
from tests.helpers import GEOSTATIONARY_M, LOW_SHELL


LOW, HIGH = LOW_SHELL, Shell(8e3, 12e3)
MANY = 10_000


def _rays() -> Rays:
    """Over the whole disc and beyond its edge, some of them along the limb."""
    rng = np.random.default_rng(0)
    angle = np.radians(8.75) * np.sqrt(rng.random(MANY))
    angle[::10] = np.radians(8.7) + np.radians(0.01) * rng.random(MANY // 10)
    turn = 2 * np.pi * rng.random(MANY)
    direction = np.stack(
        [-np.cos(angle), np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn)],
        axis=-1,
    )
    origin = np.broadcast_to(GEOSTATIONARY_M, direction.shape)
    return Rays(origin, direction, 5.6e-5)


RAYS = _rays()


def _in_parts(function):
    """What numpy finds, for few rays are not compiled."""
    parts = [function(RAYS[start : start + 1000]) for start in range(0, MANY, 1000)]
    return jax.tree.map(lambda *some: np.concatenate(some), *parts)


@pytest.mark.parametrize("shell", [LOW, HIGH])
def test_chords_of_many_rays_are_those_of_few(shell):
    """In double precision: to a tenth of a millimetre, but where a ray just grazes."""
    for one, other in zip(
        find_chords(RAYS, shell), _in_parts(lambda r: find_chords(r, shell)),
        strict=True,
    ):  # fmt: skip
        assert isinstance(one.length_m, np.ndarray)
        assert one.length_m.dtype == np.float64
        met = other.length_m > 0
        np.testing.assert_array_equal(one.length_m > 0, met)
        assert met.any()
        np.testing.assert_allclose(one.length_m, other.length_m, rtol=0, atol=1e-3)
        np.testing.assert_allclose(
            one.entry_m[met], other.entry_m[met], rtol=0, atol=1e-3
        )


def test_paths_grounds_and_kinds_of_many_rays_are_those_of_few():
    """Paths are float32; ground and kinds are not."""

    def path(rays):
        return navigate(rays, find_chords(rays, LOW)[0])

    for one, other in zip(
        jax.tree.leaves(path(RAYS)), jax.tree.leaves(_in_parts(path)), strict=True
    ):
        np.testing.assert_allclose(one, other, rtol=1e-6, atol=2e-3)
    rows = kinds(RAYS, Shell(500.0, 12e3), (LOW, HIGH))
    found = _in_parts(lambda r: kinds(r, Shell(500.0, 12e3), (LOW, HIGH)))
    assert np.mean((rows == found).all(1)) > 0.999
    assert len(np.unique(found, axis=0)) > 5
    places, hit = ground_points(RAYS)
    expected, met = _in_parts(lambda r: ground_points(r))
    np.testing.assert_array_equal(hit, met)
    np.testing.assert_allclose(
        places.latitude_deg[hit], expected.latitude_deg[hit], rtol=0, atol=1e-9
    )


@pytest.mark.parametrize(
    "projection",
    [
        ConformalConic.lambert(30.0, 60.0, -10.0),
        Mercator(0.0, 20.0),
        LatLonMap(10.0, 40.0, 20.0),
        LocalPlane(10.0, 5.0),
        GeostationaryMap(0.0),
    ],
)
def test_columns_below_many_rays_are_those_of_few(projection):
    """In float32, of columns 10 km wide: to a thousandth of one."""
    shape = (40, 60)
    grid = ColumnGrid(projection, (-3e5, -2e5), (1e4, 1e4), shape)
    heights = np.broadcast_to(np.array([500.0, 4000.0])[:, None, None], (2, *shape))
    water = np.full((1, *shape), 0.1)
    cloud = ColumnCloud.of(grid, heights, "water", water, 100 * water)

    def laid(rays):
        return cloud.navigate(rays, find_chords(rays, LOW)[0], Sampling(2e3))

    one, other = laid(RAYS), _in_parts(laid)
    near = np.abs(other.index).max((1, 2)) < 1e3
    assert near.any()
    np.testing.assert_allclose(one.index[near], other.index[near], rtol=0, atol=1e-3)
    np.testing.assert_allclose(one.per_m[near], other.per_m[near], rtol=1e-4, atol=0)


def test_air_over_many_places_is_that_over_few():
    """In the precision of JAX: a few parts in a million, of what is seen less."""
    rng = np.random.default_rng(1)
    shape = (19, 36, len(LEVELS_M))
    grid = LatLonGrid.from_axes(np.linspace(-90, 90, 19), np.arange(0, 360, 10.0))
    kelvin = 300 - 6e-3 * np.minimum(LEVELS_M, 12e3) + rng.uniform(-9, 9, shape)
    moist = rng.uniform(0, 0.02, shape) * np.exp(-LEVELS_M / 2e3)
    air = Air.of_bands((2, 13), profiles=ProfileGrid(kelvin, moist, grid))

    def looked(rays):
        return air.look(rays, ground_points(rays)[0], np.array([1.0, 0.0, 0.0]))

    for one, other in zip(
        jax.tree.leaves(looked(RAYS)), jax.tree.leaves(_in_parts(looked)), strict=True
    ):
        np.testing.assert_allclose(one, other, rtol=2e-5, atol=1e-7)
