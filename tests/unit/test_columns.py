"""Clouds on a model's columns: optical depth along rays, cover, edges."""

import dataclasses
import functools as ft

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import Occupancy, Rays
from cloudjax.clouds.columns import AbstractColumns, ColumnCloud
from cloudjax.geometry.column_grid import ColumnGrid
from cloudjax.geometry.geodesy import ecef, geodetic, up
from cloudjax.geometry.map_projections import Mercator
from cloudjax.geometry.shells import chords
from cloudjax.light.bulk_extinction import extinction_m2_g
from tests.helpers import sampling


ROWS, COLUMNS = 5, 6
GRID = ColumnGrid(Mercator(10.0, 20.0), (2e3, 2e6), (4e3, 5e3), (ROWS, COLUMNS))
RNG = np.random.default_rng(0)
# Uneven levels, over ground that rises by a kilometre.
GROUND = np.linspace(0, 1000, COLUMNS) + 30 * np.arange(ROWS)[:, None]
ENDS = np.array([0, 60, 150, 400, 900, 2000, 4500, 8000.0])[:, None, None]
HEIGHTS = ENDS * (1 - GROUND / 2e4) + GROUND
CONTENT = RNG.gamma(0.4, 0.2, (7, ROWS, COLUMNS)) * (
    RNG.random((7, ROWS, COLUMNS)) < 0.7
)
CONTENT[[0, 6]] = 0
RADIUS = RNG.uniform(5, 25, CONTENT.shape)
COVER = RNG.uniform(0.1, 1, CONTENT.shape)
STEPS, AT_ONCE = 24, 32


@ft.cache
def _cloud(covered=False) -> ColumnCloud:
    cover = COVER if covered else None
    return ColumnCloud.of(GRID, HEIGHTS, "water", CONTENT, RADIUS, cover)


def _depth(cells=CONTENT) -> np.ndarray:
    """Optical depths of the levels, by the file's own numbers."""
    per_gram = np.asarray(extinction_m2_g("water", jnp.asarray(RADIUS, float)))
    return cells * per_gram * np.diff(HEIGHTS, axis=0)


def _rays(row, column, zenith_deg=0.0, towards=(1.0, 0.5)) -> Rays:
    """From above through places on the ground, slanted along a level direction."""
    latitude, longitude = GRID.places(np.asarray(row, float), np.asarray(column, float))
    ground = ecef(latitude, longitude, np.zeros_like(latitude))
    vertical = up(latitude, longitude)
    level = np.cross([0, 0, 1.0], vertical) * towards[0] + [0, 0, towards[1]]
    level -= (level * vertical).sum(-1, keepdims=True) * vertical
    level /= np.linalg.norm(level, axis=-1, keepdims=True)
    θ = np.radians(zenith_deg)
    back = np.cos(θ) * vertical + np.sin(θ) * level
    return Rays(ground + 3e4 * back, -back, 1e-5)


@ft.partial(jax.jit, static_argnames="steps")
def _occupied(cloud: AbstractColumns, way, steps=STEPS) -> Occupancy:
    return cloud.occupancy(cloud.sample(way, (), steps=steps, slopes=False), steps)


def _seen(cloud: AbstractColumns, rays: Rays, steps=STEPS) -> np.ndarray:
    """Optical depth along the rays of each structure [nodes rays].

    So many at a time, whatever their number: all are compiled once.
    """
    found, count = [], len(rays)
    for start in range(0, count, AT_ONCE):
        some = rays[np.minimum(start + np.arange(AT_ONCE), count - 1)]
        way = cloud.navigate(some, chords(some, cloud.shell), sampling())
        fraction = np.asarray(_occupied(cloud, way, steps).fraction)
        step = cloud.extinction_per_m * np.asarray(way.path.length_m) / steps
        found.append(fraction.sum(-1) * step)
    return np.concatenate(found, axis=1)[:, :count]


def test_straight_down_the_depth_is_the_sum_of_the_column():
    """Levels are from 90 m to 2.5 km thick, and steps 200 m."""
    row, column = (index.ravel() for index in GRID.mesh())
    expected = _depth().sum(0).ravel()
    found = _seen(_cloud(), _rays(row, column))[0]
    np.testing.assert_allclose(found, expected, rtol=1e-3)
    np.testing.assert_allclose(_cloud().column_depth().ravel(), expected, rtol=1e-5)


def test_water_is_conserved_between_columns():
    """The mean over places that divide the cells evenly is that of the cells."""
    parts = (np.arange(4) + 0.5) / 4 - 0.5
    rows = (np.arange(ROWS)[:, None] + parts).ravel()
    columns = (np.arange(COLUMNS)[:, None] + parts).ravel()
    places = np.meshgrid(rows, columns, indexing="ij")
    found = _seen(_cloud(), _rays(places[0].ravel(), places[1].ravel()))[0]
    np.testing.assert_allclose(found.mean(), _depth().sum(0).mean(), rtol=1e-3)


def _by_quadrature(rays: Rays, points=4001) -> np.ndarray:
    """Of extinction found level by level, linear between columns at equal heights."""
    shell, depth = _cloud().shell, _depth()[1:6]
    ends = HEIGHTS[1:7]
    chord = chords(rays, shell)
    totals = []
    for i in range(len(rays)):
        s = chord.entry_m[i] + chord.length_m[i] * (np.arange(points) + 0.5) / points
        place = rays.origin_m[i] + s[:, None] * rays.direction[i]
        latitude, longitude, altitude = geodetic(place)
        row, column = GRID.index(latitude, longitude)
        u, v = np.clip(row, 0, ROWS - 1), np.clip(column, 0, COLUMNS - 1)
        j, k = (
            np.minimum(np.floor(x), n - 2).astype(int)
            for x, n in ((u, ROWS), (v, COLUMNS))
        )
        corners = [
            (j + a, k + b, abs(1 - a - (u - j)) * abs(1 - b - (v - k)))
            for a in (0, 1)
            for b in (0, 1)
        ]
        low, high = (sum(w * ends[e, a, b] for a, b, w in corners) for e in (0, -1))
        part = (altitude - low) / (high - low)
        total = np.zeros(points)
        for a, b, w in corners:
            own = (ends[:, a, b] - ends[0, a, b]) / (ends[-1, a, b] - ends[0, a, b])
            level = np.clip((own <= part).sum(0) - 1, 0, 4)
            at = np.arange(points)
            per_part = depth[level, a, b] / (own[level + 1, at] - own[level, at])
            total += w * per_part / (high - low)
        inside = (part >= 0) & (part < 1)
        inside &= (np.abs(row - 2) <= 2.5) & (np.abs(column - 2.5) <= 3)
        totals.append((total * inside).mean() * chord.length_m[i])
    return np.array(totals)


def test_slanted_depths_are_those_of_dense_quadrature():
    for zenith in (30.0, 60.0, 75.0):
        rays = _rays(RNG.uniform(1, 3, 8), RNG.uniform(1, 3, 8), zenith)
        expected = _by_quadrature(rays)
        found = _seen(_cloud(), rays, 192)[0]
        np.testing.assert_allclose(
            found, expected, rtol=0.01, atol=2e-3 * expected.max()
        )


def test_cover_gathers_water_in_structures_and_keeps_the_mean():
    cloud, (row, column) = _cloud(covered=True), (i.ravel() for i in GRID.mesh())
    assert cloud.nodes == 4
    found = _seen(cloud, _rays(row, column))
    np.testing.assert_allclose(found.mean(0), _depth().sum(0).ravel(), rtol=1e-3)
    # The first quarter has all that is covered by more than that; none has less than
    # the next, and those beyond the greatest cover of a column nothing.
    assert (np.diff(found, axis=0) <= 1e-4).all()
    greatest = np.where(CONTENT > 0, COVER, 0).max(0).ravel()
    for node in range(4):
        np.testing.assert_array_equal(found[node] > 1e-6, greatest > node / 4)


def test_what_is_made_ready_is_seen_alike():
    rays = _rays(RNG.uniform(0, 4, 20), RNG.uniform(0, 5, 20), 40.0)
    cloud = _cloud(covered=True)
    np.testing.assert_allclose(
        _seen(cloud.ready(), rays), _seen(cloud, rays), rtol=1e-5
    )


def test_beyond_the_outermost_cells_there_is_nothing():
    row, column = np.array([2.0, -0.4, -0.6, 2, 2]), np.array([2.0, 2, 2, 5.4, 5.6])
    cloud, rays = _cloud(), _rays(row, column)
    found = _seen(cloud, rays)[0]
    np.testing.assert_array_equal(found > 0, [True, True, False, True, False])
    far = _rays(row[:2] + np.array([0, 40]), column[:2])
    way = cloud.navigate(far, chords(far, cloud.shell), sampling())
    np.testing.assert_array_equal(cloud.likelihood(way), [1, 0])
    # Round the globe, where the map has its seam, no way passes over the columns.
    other = Rays(-rays.origin_m, -rays.direction, 1e-5)
    way = cloud.navigate(other, chords(other, cloud.shell), sampling())
    np.testing.assert_array_equal(cloud.likelihood(way), 0)


def test_a_ray_over_the_seam_of_the_map_is_far_from_the_columns():
    """From 1° on one side of the meridian opposite to the middle to 1° on the other."""
    twenty, height = np.array([20.0]), np.array([5e3])
    y, z = (ecef(twenty, np.array([d]), height) for d in (-171.0, -169.0))
    way = (z - y) / np.linalg.norm(z - y)
    rays = Rays(y, way, 1e-5)
    cloud = _cloud()
    laid = cloud.navigate(rays, chords(rays, cloud.shell), sampling(knots=9))
    np.testing.assert_array_equal(cloud.likelihood(laid), 0)


def test_a_branch_straight_up_reads_the_column_above_it():
    cloud, rays = _cloud(), _rays([2.0], [3.0])
    way = cloud.navigate(rays, chords(rays, cloud.shell), sampling())
    heights = HEIGHTS[:, 2, 3]
    # From below all levels with cloud, and from the top of the lowest four of them.
    for level in (1, 5):
        distance = np.asarray(way.path.entry_altitude_m) - heights[level]
        ends = jnp.linspace(0, cloud.shell.top_m - heights[level], STEPS + 1)[None]
        leave = cloud.branch(way, (), jnp.asarray(distance), -way.path.direction, ends)
        found = _occupied(cloud, leave).fraction[0, 0].sum() * (ends[0, 1] - ends[0, 0])
        expected = _depth()[level:, 2, 3].sum()
        # Heights are told apart by 100 m.
        blurred = 50 * np.ptp(_depth()[level - 1 : level + 1, 2, 3] / np.diff(
            heights)[level - 1 : level + 1]) * (level > 1)  # fmt: skip
        assert found * cloud.extinction_per_m == pytest.approx(
            expected, rel=1e-3, abs=blurred
        )


def test_derivatives_by_water_and_radius_are_those_of_differences():
    rays = _rays(RNG.uniform(0, 4, 6), RNG.uniform(0, 5, 6), 50.0)
    with jax.enable_x64(True):
        cloud = ColumnCloud.of(GRID, HEIGHTS, "water", CONTENT, RADIUS, COVER, nodes=2)
        way = cloud.navigate(rays, chords(rays, cloud.shell), sampling())
        names = ("content_g_m3", "effective_radius_um", "cover")

        def passed(x):
            moved = {
                name: getattr(cloud, name) * (1 + 0.1 * x[i])
                for i, name in enumerate(names)
            }
            found = _occupied(dataclasses.replace(cloud, **moved), way).fraction
            length = way.path.length_m[None] / STEPS * cloud.extinction_per_m
            return jnp.exp(-found.sum(-1) * length).mean(0)

        zero, h = jnp.zeros(3), 1e-5
        along = jax.jit(lambda x, e: jax.jvp(passed, (x,), (e,)))
        forward = np.stack([along(zero, e)[1] for e in jnp.eye(3)], axis=-1)
        reverse = jax.jit(jax.grad(lambda x: passed(x).sum()))(zero)
        ends = [along(h * e, e)[0] - along(-h * e, e)[0] for e in jnp.eye(3)]
    np.testing.assert_allclose(forward.sum(0), reverse, rtol=1e-8, atol=1e-14)
    differences = np.stack(ends, axis=-1) / (2 * h)
    np.testing.assert_allclose(forward, differences, rtol=1e-4, atol=1e-9)
    # More water and smaller droplets let less light through.
    assert (np.asarray(forward)[:, 0] <= 0).all()
    assert (np.asarray(forward)[:, 1] >= 0).all()
    assert np.abs(forward).max(0).min() > 1e-5


def test_what_makes_no_cloud_is_refused():
    with pytest.raises(ValueError, match="no cloud"):
        ColumnCloud.of(GRID, HEIGHTS, "water", 0 * CONTENT, RADIUS)
    with pytest.raises(ValueError, match="do not rise"):
        ColumnCloud.of(GRID, HEIGHTS[::-1], "water", CONTENT, RADIUS)
