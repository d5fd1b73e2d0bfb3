"""Statistics of neighbouring pixels and bands, against sums by numpy."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from tests.small_fits import BLOCKS, SHAPE, flecked, small_imagery, small_target

from cloudjax_fit.functionals import Increments, Pairs, Pixels, image_pairs
from cloudjax_fit.observation import target_of
from cloudjax_fit.ray_choice import DRAWS, draw_rays
from cloudjax_fit.statistics import EdgeShares, Histograms, MeanSquares
from cloudjax_fit.targets import block_of_pixels


LAGS = (1, 2)


@pytest.fixture(scope="module")
def target():
    return small_target(small_imagery(), flecked())


def _weights(target, images):
    both = np.stack([images[1].reshape(-1), images[13].reshape(-1)])
    scene = target.imagery.empty_scene
    return both, np.asarray(
        target.imagery.rule.weights(jnp.asarray(both, float), scene)
    )


def _pixels(target, images) -> Pixels:
    both, weights = _weights(target, images)
    return Pixels(
        radiance=jnp.asarray(both, float) / target.statistics.deviations[:, None],
        weights=jnp.asarray(weights),
        known=jnp.ones(both.shape[1]),
        block=jnp.asarray(block_of_pixels(SHAPE, BLOCKS)),
        pairs=Pairs.of(image_pairs(target.good, target.statistics.lags)),
    )


def _part(target, kind):
    return next(one for one in target.statistics.all if isinstance(one, kind))


def test_lags_are_those_that_an_image_holds(target):
    assert target.statistics.lags == (1, 2)


def test_an_image_fits_itself(target):
    """Soft weights or sharp ones: both sides are of the same kind of pixel.

    Tolerance: what weights of less than a thousandth, left out of the image, amount to.
    """
    pixels = _pixels(target, flecked())
    for one in target.statistics.all:
        found = np.asarray(one.residuals(one.sums(pixels, 16)))
        np.testing.assert_allclose(found, 0.0, atol=0.05)


def test_another_image_does_not_fit(target):
    pixels = _pixels(target, {n: i[::-1] ** 1.02 for n, i in flecked(1).items()})
    for one in target.statistics.all:
        assert np.abs(one.residuals(one.sums(pixels, 16))).max() > 0.3


def test_mean_squares_are_those_of_all_pairs(target):
    """By numpy, from shifted images."""
    images = flecked()
    squares = np.asarray(_part(target, MeanSquares).observed).sum(0)
    found = (squares[:, 0] / squares[:, 1]).reshape(2, len(LAGS))
    for row, (number, image) in enumerate(images.items()):
        scaled = image / float(target.statistics.deviations[row])
        for column, lag in enumerate(LAGS):
            along = (scaled[:, lag:] - scaled[:, :-lag]).reshape(-1)
            across = (scaled[lag:] - scaled[:-lag]).reshape(-1)
            expected = np.mean(np.concatenate([along, across]) ** 2)
            assert found[row, column] == pytest.approx(expected, rel=1e-4), number


def test_edges_are_pairs_of_which_one_is_cloud(target):
    _, weights = _weights(target, flecked())
    weights = weights.reshape(SHAPE)
    sums = np.asarray(_part(target, EdgeShares).observed).sum(0)
    for row, lag in enumerate(LAGS):
        ends = [(weights[:, lag:], weights[:, :-lag]), (weights[lag:], weights[:-lag])]
        a, b = (np.concatenate([e[i].reshape(-1) for e in ends]) for i in (0, 1))
        assert sums[row, 1] == len(a)
        expected = (a * (1 - b) + b * (1 - a)).sum()
        assert sums[row, 0] == pytest.approx(expected, rel=2e-3)


def test_of_many_pairs_some_are_taken_from_everywhere():
    """100 × 80 pixels, 7 of 10 good: of each direction at most 500, evenly."""
    good = np.random.default_rng(0).random((100, 80)) < 0.7
    every, some = (image_pairs(good, LAGS, most) for most in (10**6, 500))
    for lag, pairs, chosen in zip(LAGS, every, some, strict=True):
        rows = good[lag:] & good[:-lag], good[:, lag:] & good[:, :-lag]
        assert pairs.shape[1] == sum(both.sum() for both in rows)
        assert 500 < chosen.shape[1] <= 1000
        assert set(map(tuple, chosen.T)) <= set(map(tuple, pairs.T))
        # Of a tenth of the image a tenth, within 2 %.
        tenth = np.histogram(chosen[0], bins=10, range=(0, good.size))[0]
        np.testing.assert_allclose(tenth / chosen.shape[1], 0.1, atol=0.02)


def test_increments_are_counted_in_cloud_and_at_its_edge(target):
    """Weights: both ends, w w'; an end at least, w + w' - w w'. Tolerance: bins share
    what is near their edges."""
    increments = target.statistics.parts[2]
    assert isinstance(increments, Histograms)
    assert isinstance(increments.functional, Increments)
    images, (_, weights) = flecked(), _weights(target, flecked())
    size = np.asarray(increments.functional.size)
    observed = np.asarray(increments.observed).sum(0).reshape(2, 2, len(LAGS), -1)
    for row, image in enumerate(images.values()):
        scaled = (image / float(target.statistics.deviations[row])).reshape(-1)
        for column, pairs in enumerate(image_pairs(target.good, LAGS)):
            first, second = pairs
            both = weights[first] * weights[second]
            for kind, share in enumerate(
                (both, weights[first] + weights[second] - both)
            ):
                number = (kind * 2 + row) * len(LAGS) + column
                high = float(increments.bins.high[number])
                edges = np.linspace(-high, high, increments.bins.count + 1)
                change = (scaled[second] - scaled[first]) / size[row, column]
                where = np.clip(np.arcsinh(change), -high, high)
                counts, _ = np.histogram(where, edges, weights=share)
                found = observed[kind, row, column]
                assert found.sum() == pytest.approx(share.sum(), rel=5e-3)
                apart = np.abs(np.cumsum(found) - np.cumsum(counts)).max()
                assert apart < 0.04 * share.sum()


def test_missing_pixels_make_no_pairs():
    good = np.ones(SHAPE, bool)
    good[10:14] = False
    target = target_of(small_imagery(), flecked(), good, BLOCKS)
    pairs = np.asarray(_part(target, MeanSquares).observed)[:, :2, 1].sum(0)
    rows, columns = good.sum(), (good[1:] & good[:-1]).sum()
    assert pairs[0] == rows - good.any(1).sum() + columns


@pytest.fixture(scope="module")
def large():
    """Of an image that is half missing."""
    grid_shape = (96, 80)
    rng = np.random.default_rng(0)
    imagery = small_imagery()
    grid = replace(
        imagery.grid,
        x_rad=imagery.grid.x_rad[0] + 5.6e-5 * np.arange(grid_shape[1]),
        y_rad=imagery.grid.y_rad[0] - 5.6e-5 * np.arange(grid_shape[0]),
    )
    images = {
        1: rng.uniform(10.0, 300.0, grid_shape),
        13: rng.uniform(30.0, 90.0, grid_shape),
    }
    good = np.ones(grid_shape, bool)
    good[:, 30:45] = False
    return target_of(replace(imagery, grid=grid), images, good, BLOCKS)


def test_rays_are_clusters_of_neighbours(large):
    """Every pair is one lag apart in a row or a column, and of pixels that count.

    It goes to the right or down, as those of images do: increments have a sign.
    """
    chosen = draw_rays(large, 2000, 0, texture=True)
    assert chosen.lags == large.statistics.lags == (1, 2, 4, 8)
    assert len(chosen.pixels) == 2000 // 9 * 9
    assert large.good.reshape(-1)[chosen.pixels].all()
    rows, columns = np.divmod(chosen.pixels, 80)
    for lag, (first, second) in zip(chosen.lags, chosen.pairs, strict=True):
        down, right = rows[second] - rows[first], columns[second] - columns[first]
        np.testing.assert_array_equal(np.abs(down) + np.abs(right), lag)
        assert (down * right == 0).all()
        ways = {(np.sign(d), np.sign(r)) for d, r in zip(down, right, strict=True)}
        assert ways == {(1, 0), (0, 1)}
        ends = chosen.pixels[first], chosen.pixels[second]
        every = image_pairs(large.good, (lag,))[0]
        assert {*zip(*ends, strict=True)} <= {*map(tuple, every.T)}


def test_neighbours_see_one_draw_of_the_clouds_and_all_draws_the_whole_image(large):
    """Pairs are of one cloud; rays of each draw are in all quarters of the image."""
    chosen = draw_rays(large, 6000, 0, texture=True)
    for first, second in chosen.pairs:
        np.testing.assert_array_equal(chosen.draw[first], chosen.draw[second])
    quarter = chosen.pixels // 80 * 4 // 96
    count = np.zeros((DRAWS, 4))
    np.add.at(count, (chosen.draw, quarter), 1)
    assert count.min() > 0.3 * count.mean()
    alone = draw_rays(large, 500, 0, texture=False)
    assert len(set(alone.draw)) == DRAWS


def test_rays_leave_no_part_of_the_image_out(large):
    """Shares of rays in eighths of the image, by rows and columns. Tolerance: a half,
    for the outermost pixels are in fewer clusters."""
    chosen = draw_rays(large, 6000, 1, texture=True)
    rows, columns = np.divmod(chosen.pixels, 80)
    for at, size, good in ((rows, 96, large.good.T), (columns, 80, large.good)):
        held = np.bincount(at[chosen.known > 0] * 8 // size, minlength=8)
        there = np.bincount(np.nonzero(good)[1] * 8 // size, minlength=8)
        share = (held / held.sum())[there > 0] / (there / there.sum())[there > 0]
        assert share.min() > 0.5
        assert share.max() < 1.5


def test_the_number_of_rays_does_not_depend_on_what_is_missing(large):
    scarce = replace(large, good=large.good & (np.arange(96) < 20)[:, None])
    chosen = draw_rays(scarce, 2000, 0, texture=True)
    assert len(chosen.pixels) == 2000 // 9 * 9
    assert 0 < chosen.known.mean() <= 1


def test_values_alone_are_of_single_pixels(large):
    chosen = draw_rays(large, 500, 0, texture=False)
    assert chosen.lags == ()
    assert chosen.pairs == []
    assert len(np.unique(chosen.pixels)) == 500
