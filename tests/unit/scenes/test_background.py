"""What is seen without clouds, of pixels that are not all clear."""

import numpy as np
import pytest

from cloudjax_scenes.background import (
    Background,
    clear_pixels,
    observed_background,
)
from cloudjax_scenes.surface import Surface
from tests.generated import window


# The coast of California runs through it.
GRID = window((64, 64))
SEA, LAND = 4.0, 60.0


@pytest.fixture(scope="module")
def land():
    ground, _ = GRID.rays().ground()
    share = Surface.of().land_at(ground.latitude_deg, ground.longitude_deg)
    land = share.reshape(GRID.shape) > 0.5
    assert 0.1 < land.mean() < 0.9
    return land


def _reduced(image, clear):
    told = clear_pixels(GRID, clear, {3: image / 100})
    return observed_background(GRID, told, {3: image}).radiance[3]


def test_pixels_under_cloud_are_filled_from_the_like(land):
    """Up to the coast, and farther than any average over both would be."""
    ground = np.where(land, LAND, SEA)
    clear = np.random.default_rng(0).random(GRID.shape) < 0.1
    cloudy = np.where(clear, ground, 300.0)
    np.testing.assert_allclose(_reduced(cloudy, clear), ground)


def test_thin_cloud_at_sea_is_not_the_ground(land):
    """Three tenths of the sea show thin cloud that no rule takes for one; the sea's own
    spread of 0.01 stays as it is, and so does all that land shows."""
    rng = np.random.default_rng(1)
    ground = np.where(
        land, rng.uniform(20, 90, GRID.shape), rng.uniform(3, 4, GRID.shape)
    )
    thin = ~land & (rng.random(GRID.shape) < 0.3)
    found = _reduced(np.where(thin, ground + 10, ground), np.ones(GRID.shape, bool))
    np.testing.assert_array_equal(found[~thin], ground[~thin])
    assert found[thin].max() < 4.0


def test_what_is_unknown_does_not_spread(land):
    """Pixels without data hold NaN."""
    ground = np.where(land, LAND, SEA)
    clear = np.ones(GRID.shape, bool)
    clear[10:50, 10:50] = False
    found = _reduced(np.where(clear, ground, np.nan), clear)
    np.testing.assert_allclose(found, ground)


def test_one_clear_pixel_is_all_that_is_known():
    clear = np.zeros(GRID.shape, bool)
    clear[-1, 5] = True
    np.testing.assert_allclose(_reduced(np.where(clear, 7.0, np.nan), clear), 7.0)


def test_means_over_blocks_of_pixels():
    image = np.arange(64.0 * 64).reshape(64, 64)
    coarse = Background(GRID, {3: image}).coarsened(8)
    assert coarse.grid.shape == (8, 8)
    assert coarse.radiance[3][1, 2] == image[8:16, 16:24].mean()
