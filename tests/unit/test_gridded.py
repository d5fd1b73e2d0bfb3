"""Clouds on a grid: values where they belong, edges, slopes."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import POINT, GriddedCloud, Rays, Shell
from cloudjax.geometry.geodesy import east_north_up, ecef
from cloudjax.geometry.shells import chords


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


def _sampled(cloud: GriddedCloud, rays: Rays, steps=4, with_gradient=False):
    way = cloud.navigate(rays, chords(rays, SHELL))
    textures = cloud.make_textures(POINT, 8)
    return cloud.sample(way, textures, steps=steps, with_gradient=with_gradient)


def test_centres_of_cells_have_their_values():
    i, j = np.divmod(np.arange(15), 5)
    found = _sampled(_cloud(), _rays(200 * i + 100.0, 100 * j + 50.0))
    # From the top down; half a kilometre off, the Earth has dropped by 3 cm.
    np.testing.assert_allclose(found.density.values, VALUES[i, j, ::-1], atol=1e-3)


def test_a_grid_ends_unless_it_is_periodic():
    rays = _rays(np.array([-300.0, 900.0, 300.0]), np.array([50.0, 50.0, -950.0]))
    np.testing.assert_allclose(_sampled(_cloud(), rays).density.values, 0, atol=1e-6)
    found = _sampled(_cloud(periodic=True), rays).density.values
    expected = VALUES[[1, 1, 1], [0, 0, 0], ::-1]
    np.testing.assert_allclose(found, expected, atol=1e-2)


def test_slopes_are_those_of_the_values_in_space():
    """A density of 1e-4, 2e-4 and -5e-4 per metre to the east, north and up."""
    x, y, z = np.meshgrid(np.arange(8), np.arange(9), np.arange(4), indexing="ij")
    cloud = _cloud((0.02 * x + 0.02 * y - 0.05 * z + 1).astype(np.float32))
    found = _sampled(cloud, _rays(np.array([750.0]), np.array([420.0])), 4, True)
    slopes = east_north_up(*CORNER) @ np.asarray(found.gradient)[:, 0]
    expected = np.array([1e-4, 2e-4, -5e-4])
    np.testing.assert_allclose(slopes[:, 1], expected, rtol=1e-3)
    occupied = cloud.occupancy(found, 4).slopes
    assert occupied is not None
    assert occupied.gradient is found.gradient


def test_a_branch_reads_the_grid_in_its_own_direction():
    """From a point straight up, the column above it."""
    cloud, rays = _cloud(), _rays(np.array([300.0]), np.array([250.0]))
    way = cloud.navigate(rays, chords(rays, SHELL))
    up = jnp.asarray(east_north_up(*CORNER)[2], float)
    ends = jnp.asarray([[0.0, 100.0, 200.0]])
    branch = cloud.branch(way, jnp.asarray([200.0]), up, ends)
    textures = cloud.make_textures(POINT, 8)
    found = cloud.sample(branch, textures, steps=2, with_gradient=False)
    np.testing.assert_allclose(found.density.values[0], VALUES[1, 2, 2:], atol=1e-3)


def test_masks_and_winds_are_refused():
    cloud, rays = _cloud(), _rays(np.zeros(1), np.zeros(1))
    with pytest.raises(ValueError, match="no masks, no wind"):
        cloud.navigate(rays, chords(rays, SHELL), lambda φ, λ: φ)


def test_the_grid_is_data_of_the_source():
    assert eqx.tree_equal(_cloud().make_textures(POINT, 8)[0], jnp.asarray(VALUES))
