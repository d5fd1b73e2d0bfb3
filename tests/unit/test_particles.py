"""Particles of cloud: where they stand, how they move, and how few will do."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import chisquare

from cloudjax.geometry.column_grid import ColumnGrid
from cloudjax.geometry.geodesy import ecef
from cloudjax.geometry.map_projections import ConformalConic, LocalPlane
from cloudjax.particles.cloud_particles import CloudParticles
from cloudjax.particles.detail import LevelOfDetail
from cloudjax.particles.motion import ColumnWinds, accelerated, carried, succeeding
from cloudjax.particles.placement import (
    Acceptance,
    DepthColumns,
    Systematic,
    cell_of,
    place,
)


ROWS, COLUMNS, LEVELS = 12, 15, 6
MAP = ConformalConic.lambert(30.0, 60.0, -97.0)
X, Y = (float(v[0]) for v in MAP.project(np.array([40.0]), np.array([-80.0])))
GRID = ColumnGrid(MAP, (X, Y), (3000.0, 2000.0), (ROWS, COLUMNS))
MANY = 100_000


def _columns(seed=0, clear=0.4) -> DepthColumns:
    """Uneven levels over rising ground; two fifths of the columns have no cloud."""
    rng = np.random.default_rng(seed)
    depth = rng.gamma(0.5, 2.0, (LEVELS, ROWS, COLUMNS))
    depth[:, rng.uniform(size=(ROWS, COLUMNS)) < clear] = 0
    depth[rng.uniform(size=depth.shape) < 0.3] = 0
    ends = np.array([0, 100, 300, 700, 1500, 3000, 6000.0])
    heights = ends[:, None, None] + 50 * np.arange(ROWS)[:, None] + 0 * depth[:1]
    return DepthColumns(GRID, heights, depth)


def _cells(particles: CloudParticles, columns: DepthColumns):
    row, column = GRID.index(particles.latitude_deg, particles.longitude_deg)
    row, column = (np.rint(index).astype(int) for index in (row, column))
    ends = columns.heights_m[:, row, column]
    return (ends[1:] < particles.altitude_m - 1e-6).sum(axis=0), row, column


def _summed(particles: CloudParticles, columns: DepthColumns) -> np.ndarray:
    """Extinction area by cell."""
    total = np.zeros(columns.depth.shape)
    np.add.at(total, _cells(particles, columns), particles.extinction_area_m2)
    return total


SAMPLERS = pytest.mark.parametrize("sampler", [Systematic(), Acceptance(1.0)])


@SAMPLERS
def test_areas_add_up_to_those_of_the_cloud(sampler):
    columns = _columns()
    for count in (1, 7, 1000):
        found = place(columns, count, sampler=sampler).extinction_area_m2
        assert len(found) == count
        whole = (columns.column_depth * GRID.area_m2()).sum()
        np.testing.assert_allclose(found.sum(), whole, rtol=1e-12)


@SAMPLERS
def test_columns_have_their_optical_depth_within_the_error_of_counts(sampler):
    columns = _columns()
    particles = place(columns, MANY, sampler=sampler, seed=3)
    cells, area = _summed(particles, columns), GRID.area_m2()
    one = particles.extinction_area_m2.max()
    off = np.abs(cells.sum(0) / area - columns.column_depth)
    assert cells.sum(0)[columns.column_depth == 0].max() == 0
    assert (off <= 3.5 * np.sqrt(columns.column_depth * area * one) / area + 1e-9).all()
    # So do levels: particles stand where the profile of their column has its cloud.
    level = np.abs(cells / area - columns.depth)
    assert (level <= 4.5 * np.sqrt(columns.depth * area * one) / area + 1e-9).all()


def test_equal_strides_miss_no_cell_by_more_than_a_particle():
    columns = _columns()
    particles = place(columns, MANY)
    off = np.abs(_summed(particles, columns) - columns.depth * GRID.area_m2())
    assert off.max() <= 1.001 * particles.extinction_area_m2[0]


def test_acceptance_is_in_proportion_up_to_k_of_one_and_not_beyond():
    """χ² of the counts by columns; with K = 5 thick columns are all alike."""
    columns = _columns()
    expected = columns.column_depth / columns.column_depth.sum() * MANY

    def counts(k):
        drawn = Acceptance(k).draw(columns, MANY, np.random.default_rng(1))
        found = np.zeros((ROWS, COLUMNS))
        np.add.at(found, (drawn.row, drawn.column), 1)
        return found

    some = expected > 0
    for k in (0.5, 1.0):
        assert chisquare(counts(k)[some], expected[some]).pvalue > 1e-3
    assert chisquare(counts(5.0)[some], expected[some]).pvalue < 1e-12
    capped = np.minimum(5 * columns.column_depth / columns.column_depth.max(), 1)
    capped *= MANY / capped.sum()
    assert chisquare(counts(5.0)[some], capped[some]).pvalue > 1e-3


def test_cells_are_the_quotient_and_the_rest():
    index = np.arange(ROWS * COLUMNS)
    row, column = cell_of(index, COLUMNS)
    np.testing.assert_array_equal(row * COLUMNS + column, index)
    assert (row.max(), column.max()) == (ROWS - 1, COLUMNS - 1)


def test_particles_fill_their_cells():
    """Evenly to all sides: no lattice of middles shows."""
    depth = np.zeros((LEVELS, ROWS, COLUMNS))
    depth[3, 5, 7] = 2.0
    columns = dataclasses.replace(_columns(), depth=depth)
    particles = place(columns, 2000)
    row, column = GRID.index(particles.latitude_deg, particles.longitude_deg)
    low = columns.heights_m[3, 5, 7]
    for part in (row - 4.5, column - 6.5, (particles.altitude_m - low) / 800):
        assert 0 <= part.min() < 0.01
        assert 0.99 < part.max() <= 1
        np.testing.assert_allclose(np.histogram(part, 4)[0], 500, atol=80)
    # Their spheres hold the cloud's extinction: 2 in 800 m.
    volume = 4 / 3 * np.pi * particles.radius_m**3
    np.testing.assert_allclose(particles.extinction_area_m2 / volume, 2 / 800)
    through = particles.extinction_area_m2 / (np.pi * particles.radius_m**2)
    np.testing.assert_allclose(particles.opacity, 1 - np.exp(-through))


def test_the_same_seed_gives_the_same_particles():
    one, two, other = (place(_columns(), 50, seed=s) for s in (4, 4, 5))
    np.testing.assert_array_equal(one.latitude_deg, two.latitude_deg)
    assert np.abs(one.latitude_deg - other.latitude_deg).max() > 1e-4


def test_what_makes_no_particles_is_refused():
    with pytest.raises(ValueError, match="0 particles"):
        place(_columns(), 0)
    with pytest.raises(ValueError, match="K = 0"):
        Acceptance(0.0)
    empty = dataclasses.replace(_columns(), depth=np.zeros((LEVELS, ROWS, COLUMNS)))
    with pytest.raises(ValueError, match="no cloud"):
        place(empty, 5)
    with pytest.raises(ValueError, match="more than 0"):
        LevelOfDetail(0.0)


# motion


def test_newtons_law_moves_each_component():
    particles = dataclasses.replace(
        place(_columns(), 20), velocity_m_s=np.tile([30.0, -20.0, 1.0], (20, 1))
    )
    a = np.array([[0.01, 0.02, -0.001]])
    moved = accelerated(particles, 600.0, a)
    way = np.array([30.0, -20.0, 1.0]) * 600 + a[0] * 600**2 / 2
    far = np.radians(moved.latitude_deg - particles.latitude_deg) * 6.371e6
    np.testing.assert_allclose(far, way[1], rtol=0.01)
    east = np.radians(moved.longitude_deg - particles.longitude_deg)
    east *= 6.371e6 * np.cos(np.radians(particles.latitude_deg))
    np.testing.assert_allclose(east, way[0], rtol=0.01)
    np.testing.assert_allclose(moved.altitude_m - particles.altitude_m, way[2])
    np.testing.assert_allclose(moved.velocity_m_s[0], [36.0, -8.0, 0.4])


def _turning(period_s: float, rising_m_s=0.0) -> tuple[ColumnGrid, ColumnWinds]:
    """Air that turns about the middle of a plane as a solid does."""
    grid = ColumnGrid(LocalPlane(10.0, 20.0), (-5e4, -5e4), (1e4, 1e4), (11, 11))
    y, x = (1e4 * (index - 5) for index in grid.mesh())
    w = 2 * np.pi / period_s
    level = np.ones((3, 1, 1))
    winds = np.stack([-w * y * level, w * x * level, rising_m_s + 0 * x * level])
    heights = np.array([0, 1e3, 3e3, 6e3])[:, None, None] + np.zeros((11, 11))
    return grid, ColumnWinds.of(grid, heights, winds[None], np.zeros(1))


def _some(count=30) -> CloudParticles:
    rng = np.random.default_rng(0)
    zero = np.zeros(count)
    return CloudParticles(
        10 + rng.uniform(-0.3, 0.3, count),
        20 + rng.uniform(-0.3, 0.3, count),
        rng.uniform(500, 4000, count),
        zero + 100,
        zero + 1e6,
        np.zeros((count, 3)),
        zero - np.inf,
        zero + np.inf,
        zero,
    )


def test_solid_rotation_closes_and_half_of_it_does_not():
    particles, (grid, winds) = _some(), _turning(3600.0)

    def away(seconds):
        moved = carried(
            particles, grid, winds, start_s=0.0, duration_s=seconds, steps=40
        )
        apart = np.linalg.norm(moved.position_m() - particles.position_m(), axis=1)
        centre = np.linalg.norm(
            particles.position_m() - _middle(particles.altitude_m), axis=1
        )
        return apart / centre

    assert away(3600.0).max() < 1e-3
    np.testing.assert_allclose(away(1800.0), 2, rtol=2e-3)


def _middle(altitude_m):
    return ecef(
        np.full_like(altitude_m, 10.0), np.full_like(altitude_m, 20.0), altitude_m
    )


def test_winds_carry_back_what_they_carried():
    particles, (grid, winds) = _some(), _turning(7200.0, rising_m_s=0.2)
    there = carried(particles, grid, winds, start_s=0.0, duration_s=900.0)
    np.testing.assert_allclose(there.altitude_m - particles.altitude_m, 180, atol=0.01)
    back = carried(there, grid, winds, start_s=900.0, duration_s=-900.0)
    apart = np.linalg.norm(back.position_m() - particles.position_m(), axis=1)
    assert apart.max() < 2.0


def test_winds_change_between_model_times():
    grid, winds = _turning(3600.0)
    still = dataclasses.replace(
        winds,
        rates=jnp.stack([0 * winds.rates[0], winds.rates[0]]),
        time_s=jnp.array([0.0, 600.0]),
    )
    one, two = (
        carried(_some(), grid, w, start_s=0.0, duration_s=d, steps=8)
        for w, d in ((still, 600.0), (winds, 300.0))
    )
    # A rate that grows evenly turns as far as its mean does.
    np.testing.assert_allclose(one.latitude_deg, two.latitude_deg, atol=1e-5)


def test_one_cloud_turns_into_the_next():
    before, after = succeeding(place(_columns(0), 400), place(_columns(1), 300), 3600.0)
    for part in (0.0, 0.25, 0.5, 0.9):
        now = 3600.0 * part
        assert len(before.alive(now)) == pytest.approx(400 * (1 - part), abs=1)
        assert len(after.alive(now)) == pytest.approx(300 * part, abs=1)


# level of detail


@pytest.mark.parametrize("power", [1.0, 3.0])
def test_numbers_fall_with_the_distance_as_the_laws_say(power):
    detail, particles = LevelOfDetail(1e4, power), place(_columns(), 6400)
    for far in (0.5, 1.0, 2.0, 4.0):
        distance = np.full(6400, far * 1e4)
        thin = detail.thinned(particles, distance)
        expected = 6400 * min(1.0, far**-power)
        assert len(thin) == pytest.approx(expected, abs=1)
        grown = max(far, 1.0) ** (power / 3)
        np.testing.assert_allclose(np.median(thin.radius_m) / grown,
                                   np.median(particles.radius_m), rtol=0.3)  # fmt: skip
    one = detail.thinned(particles, np.full(6400, 1e9))
    assert len(one) == 1


def test_few_particles_keep_the_optical_depth_of_many():
    """1/64 of them: the mean exactly, halves of the area within some per cent."""
    columns = _columns()
    particles = place(columns, MANY)
    thin = LevelOfDetail(1e4).thinned(particles, np.full(MANY, 4e4))
    assert len(thin) == pytest.approx(MANY / 64, abs=1)
    whole = particles.extinction_area_m2.sum()
    np.testing.assert_allclose(thin.extinction_area_m2.sum(), whole, rtol=1e-12)
    by_row = [_summed(p, columns).sum((0, 2)) for p in (particles, thin)]
    np.testing.assert_allclose(by_row[1], by_row[0], rtol=0.03)


def test_detail_is_kept_near_the_viewer():
    particles = place(_columns(), 5000)
    distance = np.where(particles.latitude_deg > 40.1, 5e3, 2e4)
    thin = LevelOfDetail(1e4).thinned(particles, distance)
    near = (thin.latitude_deg > 40.1).sum()
    assert near == pytest.approx((distance < 1e4).sum(), rel=0.02)
    far = (thin.latitude_deg <= 40.1).sum()
    assert far == pytest.approx((distance > 1e4).sum() / 8, rel=0.05)
