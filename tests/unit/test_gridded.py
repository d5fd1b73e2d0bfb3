"""Clouds on a grid: values where they belong, edges, slopes."""

import jax
import jax.numpy as jnp
import numpy as np

from cloudjax import GriddedCloud, Occupancy, Rays, Shell
from cloudjax.geometry.geodesy import east_north_up, ecef
from cloudjax.geometry.shells import chords
from tests.helpers import sampling


SHELL = Shell(1000.0, 1400.0)
CORNER = (20.0, 10.0)
VALUES = np.random.default_rng(0).random((3, 5, 4)).astype(np.float32)


def _cloud(values=VALUES, **grid) -> GriddedCloud:
    return GriddedCloud(
        density=jnp.asarray(values),
        shell=SHELL,
        corner_deg=CORNER,
        spacing_m=(200.0, 100.0),
        **grid,
    )


def _rays(east_m, north_m) -> Rays:
    """Straight down over the corner's plane."""
    east, north, up = east_north_up(*CORNER)
    corner = ecef(np.array(CORNER[:1]), np.array(CORNER[1:]), np.zeros(1))
    ground = corner + np.outer(east_m, east) + np.outer(north_m, north)
    down = np.broadcast_to(-up, ground.shape)
    return Rays(ground - 1e4 * down, down, 1e-4)


def _navigate(cloud: GriddedCloud, rays: Rays):
    return cloud.navigate(rays, chords(rays, SHELL), sampling())


def _occupied(cloud: GriddedCloud, rays: Rays, steps=4, slopes=False) -> Occupancy:
    """The density is read here and not by `sample`, for it is a parameter."""
    way = _navigate(cloud, rays)
    samples = cloud.sample(way, (), steps=steps, slopes=slopes)
    return cloud.occupancy(samples, steps)


def test_centres_of_cells_have_their_values():
    i, j = np.divmod(np.arange(15), 5)
    found = _occupied(_cloud(), _rays(200 * i + 100.0, 100 * j + 50.0))
    # From the top down; half a kilometre off, the Earth has dropped by 3 cm.
    np.testing.assert_allclose(found.fraction[0], VALUES[i, j, ::-1], atol=1e-3)


def test_a_grid_ends_unless_it_is_periodic():
    rays = _rays(np.array([-300.0, 900.0, 300.0]), np.array([50.0, 50.0, -950.0]))
    np.testing.assert_allclose(_occupied(_cloud(), rays).fraction, 0, atol=1e-6)
    found = _occupied(_cloud(periodic=True), rays).fraction[0]
    expected = VALUES[[1, 1, 1], [0, 0, 0], ::-1]
    np.testing.assert_allclose(found, expected, atol=1e-2)


def test_slopes_are_those_of_the_values_in_space():
    """A density of 1e-4, 2e-4 and -5e-4 per metre to the east, north and up."""
    x, y, z = np.meshgrid(np.arange(8), np.arange(9), np.arange(4), indexing="ij")
    cloud = _cloud((0.02 * x + 0.02 * y - 0.05 * z + 1).astype(np.float32))
    found = _occupied(cloud, _rays(np.array([750.0]), np.array([420.0])), 4, True)
    assert found.slopes is not None
    slopes = east_north_up(*CORNER) @ np.asarray(found.slopes.gradient)[:, 0]
    expected = np.array([1e-4, 2e-4, -5e-4])
    np.testing.assert_allclose(slopes[:, 1], expected, rtol=1e-3)
    # All of it is there, with nothing told apart that rises with altitude only.
    np.testing.assert_array_equal(found.slopes.rise, 0)


def test_a_branch_reads_the_grid_in_its_own_direction():
    """From a point straight up, the column above it."""
    cloud, rays = _cloud(), _rays(np.array([300.0]), np.array([250.0]))
    way = _navigate(cloud, rays)
    up = jnp.asarray(east_north_up(*CORNER)[2], float)[None]
    ends = jnp.asarray([[0.0, 100.0, 200.0]])
    branch = cloud.branch(way, (), jnp.asarray([200.0]), up, ends)
    samples = cloud.sample(branch, (), steps=2, slopes=False)
    found = cloud.occupancy(samples, 2).fraction
    np.testing.assert_allclose(found[0, 0], VALUES[1, 2, 2:], atol=1e-3)


def test_samples_say_where_and_not_what():
    """They are the same whatever the density; there is no noise to read."""
    rays = _rays(np.array([300.0]), np.array([250.0]))
    assert _cloud().make_textures() == ()
    found = [
        cloud.sample(_navigate(cloud, rays), (), steps=4, slopes=True)
        for cloud in (_cloud(), _cloud(0 * VALUES))
    ]
    for a, b in zip(*map(jax.tree.leaves, found), strict=True):
        np.testing.assert_array_equal(a, b)
