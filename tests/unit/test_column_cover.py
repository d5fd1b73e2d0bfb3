"""A class covers what its mask is asked to cover, whatever its shape and the pixels."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import ColumnCover, CoverMask, Ladder, UniformMask, cloud_classes
from cloudjax.clouds.class_files import weather_classes
from cloudjax.clouds.visibility import unseen
from cloudjax.geometry.geodesy import up
from cloudjax.geometry.rays import Rays
from cloudjax.march.make_scene import make_scene
from cloudjax.march.marched_way import march_layers
from cloudjax.march.view import look


ASKED = np.array([0.05, 0.3, 0.7, 0.95])
RAYS, HEIGHT_M = 12000, 800e3


def simple(one):
    """With fewer rungs, which compile sooner."""
    textures = tuple(
        dataclasses.replace(
            t,
            gains=(),
            ladder=Ladder(
                t.ladder.noise, t.ladder.longest_m, t.ladder.longest_m / 4.01
            ),
        )
        for t in one.textures
    )
    return dataclasses.replace(one, textures=textures)


THIN = simple(cloud_classes()["low_stratus"])
THICK = simple(weather_classes()["cumulonimbus"])
CLASSES = {
    "thin": (THIN, 1e3),
    "thin in large pixels": (THIN, 40e3),
    "thick": (THICK, 20e3),
    "heavy": (
        dataclasses.replace(THICK, threshold=1.0, mask_gain=2.0).with_values(
            {"weight_2": 1.2}
        ),
        20e3,
    ),
    "faint": (simple(cloud_classes()["cirrus"]), 20e3),
}


def rendered(one, masks, pixel_m):
    """Cover by the cloud fraction that products have, of vertical rays everywhere."""
    rng = np.random.default_rng(1)
    latitude = np.degrees(np.arcsin(rng.uniform(-1, 1, RAYS)))
    vertical = up(latitude, rng.uniform(-180, 180, RAYS))
    rays = Rays(vertical * (6378137 + HEIGHT_M), -vertical, pixel_m / HEIGHT_M)
    scene = make_scene([2], [one], cover=UniformMask(jnp.zeros(())), air=False, seed=3)
    view = look(scene, rays, np.array([1.0, 0.0, 0.0]))

    @eqx.filter_jit
    def cover(threshold):
        moved = eqx.tree_at(
            lambda s: s.layers[0].cloud.function.threshold, scene, threshold
        )
        (way,) = march_layers(moved, view)
        depth = way.layer.extinction_per_m * way.passed.depth_m * way.view_height[None]
        return 1 - way.passed.mean(unseen(depth)).mean()

    # A uniform mask is a threshold.
    return np.array([cover(one.threshold - one.mask_gain * w) for w in masks])


@pytest.mark.parametrize("name", CLASSES)
def test_a_class_covers_what_it_is_asked_to(name):
    one, pixel_m = CLASSES[name]
    column = ColumnCover.of(one)
    masks = np.asarray(column.mask_of(ASKED))
    # The tests' own noise, of 12000 rays, is 0.005.
    expected = np.minimum(ASKED, column.greatest)
    np.testing.assert_allclose(rendered(one, masks, pixel_m), expected, atol=0.03)


def test_marches_of_more_steps_have_the_same_cloud():
    """Columns by chance that differed with the steps were 0.02 to 0.05 apart."""
    one = weather_classes()["stratus"]
    few, many = (np.asarray(ColumnCover.of(one, n).mask_of(ASKED)) for n in (48, 60))
    np.testing.assert_allclose(few * one.mask_gain, many * one.mask_gain, atol=0.004)


def test_the_mask_is_monotone_and_goes_back():
    column = ColumnCover.of(THICK)
    cover = np.linspace(0.0, 1.0, 301)
    mask = np.asarray(column.mask_of(cover))
    assert (np.diff(mask) > 0).all()
    np.testing.assert_allclose(column.cover_of(mask), cover, atol=2e-4)
    assert np.ptp(column.mask_of(np.array([np.nan, 0.0]))) == 0


def test_the_mask_has_a_slope_everywhere():
    column = ColumnCover.of(THIN)
    slope = jax.jit(jax.vmap(jax.grad(column.mask_of)))
    cover = jnp.asarray([0.001, 0.1, 0.5, 0.9, 0.999])
    found, h = slope(cover), 1e-4
    numeric = (column.mask_of(cover + h) - column.mask_of(cover - h)) / (2 * h)
    np.testing.assert_allclose(found, numeric, rtol=0.1)
    assert np.isfinite(slope(jnp.asarray([0.0, 1.0]))).all()


def test_a_class_that_no_mask_moves_is_refused():
    with pytest.raises(ValueError, match="mask_gain of low_stratus"):
        ColumnCover.of(dataclasses.replace(THIN, mask_gain=0.0))


def test_half_way_to_an_overcast_node_half_the_sky_is_covered():
    """A mask that were linear itself would leave less between 0 and 30 %."""
    column = ColumnCover.of(THIN)
    latitude, longitude = np.arange(-90.0, 91.0, 30.0), np.arange(0.0, 360.0, 30.0)
    cover = np.zeros((latitude.size, longitude.size))
    cover[:, 3] = 0.3
    mask = CoverMask.of(cover, latitude, longitude, column)
    places = np.array([0.0, 10.0]), np.array([75.0, 75.0])
    np.testing.assert_allclose(column.cover_of(mask(*places)), 0.15, atol=1e-3)
    assert isinstance(mask(*places), np.ndarray)
    np.testing.assert_allclose(
        jax.jit(lambda c: CoverMask.of(c, latitude, longitude, column)(*places))(cover),
        mask(*places),
        rtol=1e-5,
    )
