import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.stats

from cloudjax_fit.histogram import (
    Bins,
    Quantiles,
    cumulative,
    distances,
    quantiles,
    sample_of,
    spline_histogram,
)


BINS = Bins(0.0, 10.0, 32)
CENTERS = (jnp.arange(32) + 0.5) * 10 / 32


def _pixels(n, low=1.0, high=9.0):
    rng = np.random.default_rng(0)
    values = jnp.asarray(rng.uniform(low, high, n), jnp.float32)
    weights = jnp.asarray(rng.uniform(0.1, 1.0, n), jnp.float32)
    return values, weights


@pytest.mark.parametrize("n", [1, 1000, 10_000])
def test_mass_is_conserved_even_outside(n):
    values, weights = _pixels(n, -20.0, 30.0)
    histogram = spline_histogram(values, weights, BINS)
    assert (histogram >= 0).all()
    np.testing.assert_allclose(histogram.sum(), weights.sum(), rtol=2e-6)


def test_mean_is_preserved_in_the_interior():
    values, weights = _pixels(1000)
    histogram = spline_histogram(values, weights, BINS)
    np.testing.assert_allclose(
        (histogram * CENTERS).sum(), (weights * values).sum(), rtol=1e-5
    )


def test_values_outside_go_to_the_last_bins():
    values = jnp.array([-5.0, 0.0, 10.0, 99.0, jnp.inf, -jnp.inf])
    histogram = np.asarray(spline_histogram(values, jnp.ones(6), BINS))
    np.testing.assert_allclose(histogram[:3], [3 / 8, 18 / 8, 3 / 8], rtol=1e-6)
    np.testing.assert_allclose(histogram[-3:], [3 / 8, 18 / 8, 3 / 8], rtol=1e-6)
    assert not histogram[3:-3].any()


def test_a_value_on_a_centre_is_shared_with_its_neighbours():
    histogram = spline_histogram(CENTERS[9:10], jnp.ones(1), BINS)
    np.testing.assert_allclose(histogram[8:11], [1 / 8, 3 / 4, 1 / 8], atol=1e-5)


def test_the_derivative_is_continuous_across_a_bin_edge():
    """Half way between centres the nearest bin changes, and the slope must not."""

    def right_bin(value):
        return spline_histogram(value[None], jnp.ones(1), BINS)[7]

    edge = BINS.edges[7]
    before, after = (
        jax.grad(right_bin)(edge + side * 1e-4 * BINS.width) for side in (-1, 1)
    )
    np.testing.assert_allclose(before, after, rtol=1e-3)
    assert before > 0


def _objective(n):
    """Three parameters to a cumulative histogram: gain, offset, softness of a mask."""
    values, _ = _pixels(n, 2.0, 8.0)

    def residual(y):
        simulated = y[0] * values + y[1]
        weights = jax.nn.sigmoid((simulated - 4.0) * y[2])
        return cumulative(spline_histogram(simulated, weights, BINS))

    return residual, jnp.array([0.9, 0.3, 2.0])


@pytest.mark.parametrize("n", [2500, 50_000])
def test_jit_jacfwd_is_jit_jacrev(n):
    residual, y = _objective(n)
    forward = jax.jit(jax.jacfwd(residual))(y)
    reverse = jax.jit(jax.jacrev(residual))(y)
    assert forward.dtype == jnp.float32
    np.testing.assert_allclose(forward, reverse, atol=2e-5 * float(abs(forward).max()))


def test_gradient_is_the_central_difference():
    # Values cross bin centres within the step: the average over 50 000 pixels of the
    # exact one-sided slopes stays within a per cent of the difference.
    residual, y = _objective(50_000)
    jacobian = jax.jacfwd(residual)(y)
    for i, step in enumerate(jnp.eye(3) * 5e-3):
        difference = (residual(y + step) - residual(y - step)) / 1e-2
        scale = float(abs(jacobian[:, i]).max())
        np.testing.assert_allclose(jacobian[:, i], difference, atol=0.02 * scale)


def test_gradient_of_one_pixel_is_exact_within_a_bin():
    def right_bin(value):
        return spline_histogram(value[None], jnp.array([2.0]), BINS)[7]

    value = CENTERS[6] + 0.3 * BINS.width
    slope = jax.grad(right_bin)(value)
    # d/dx of 2 (1/2 + x)² / 2 at x = 0.3 bins
    np.testing.assert_allclose(slope, 2.0 * 0.8 / BINS.width, rtol=1e-5)


def test_one_compilation_serves_bands_by_vmap():
    values, weights = _pixels(500)
    both = Bins(jnp.array([0.0, -5.0]), jnp.array([10.0, 20.0]), 16)
    stacked = jax.vmap(spline_histogram, (0, None, 0))(
        jnp.stack([values, 2 * values]), weights, both
    )
    second = spline_histogram(2 * values, weights, Bins(-5.0, 20.0, 16))
    np.testing.assert_allclose(stacked[1], second, rtol=1e-6)
    assert both.edges.shape == (2, 17)


@pytest.mark.parametrize("bad", [jnp.nan, jnp.inf, -jnp.inf, 3e38])
def test_pixels_of_no_weight_poison_nothing(bad):
    values, weights = _pixels(100)
    expected = cumulative(spline_histogram(values, weights, BINS))
    values, weights = jnp.append(values, bad), jnp.append(weights, 0.0)

    def moment(values, weights):
        return (cumulative(spline_histogram(values, weights, BINS)) ** 2).sum()

    np.testing.assert_allclose(
        cumulative(spline_histogram(values, weights, BINS)), expected, atol=1e-6
    )
    for gradient in jax.grad(moment, (0, 1))(values, weights):
        assert jnp.isfinite(gradient).all()
    for jacobian in jax.jacfwd(moment, (0, 1))(values, weights):
        assert jnp.isfinite(jacobian).all()


def test_a_nan_of_positive_weight_cannot_hide():
    histogram = spline_histogram(jnp.array([1.0, jnp.nan]), jnp.ones(2), BINS)
    assert jnp.isnan(histogram).any()


@pytest.mark.parametrize("total", [0.0, 1e-38, 1e-25, 1e-18])
def test_an_empty_histogram_has_finite_gradients(total):
    histogram = jnp.zeros(8).at[3].set(total)
    assert jnp.isfinite(cumulative(histogram)).all()
    for mode in jax.jacfwd, jax.jacrev:
        assert jnp.isfinite(jax.jit(mode(cumulative))(histogram)).all()
    assert total > 1e-19 or not cumulative(histogram).any()


def test_cumulative_rises_to_one_and_measures_w1():
    values, weights = _pixels(20_000)
    a = cumulative(spline_histogram(values, weights, BINS))
    b = cumulative(spline_histogram(values + 0.4, weights, BINS))
    np.testing.assert_allclose(a[-1], 1.0, rtol=1e-6)
    np.testing.assert_allclose(abs(a - b).sum() * BINS.width, 0.4, rtol=1e-3)


@pytest.mark.parametrize(
    ("low", "high", "count"), [(0.0, 1.0, 1), (1.0, 1.0, 8), (0.0, math.nan, 8)]
)
def test_impossible_bins_are_refused(low, high, count):
    with pytest.raises(ValueError, match=r"at least 3 bins|high must exceed low"):
        Bins(low, high, count)


def test_distances_are_scipys():
    rng = np.random.default_rng(1)
    a, b = rng.normal(2, 1, 3000), rng.gamma(2, 1, 2000)
    found = distances(a, b)
    ks, _ = scipy.stats.ks_2samp(a, b)
    assert found.ks == pytest.approx(ks)
    assert found.w1 == pytest.approx(scipy.stats.wasserstein_distance(a, b))
    assert found.w1_over_std == pytest.approx(found.w1 / a.std())
    assert found.bias == pytest.approx(b.mean() - a.mean())
    assert (found.n_observed, found.n_simulated) == (3000, 2000)


def test_weights_are_repetitions():
    a, b = np.array([1.0, 2.0, 5.0]), np.array([2.0, 4.0])
    weighted = distances(a, b, np.array([3.0, 1.0]))
    repeated = distances(a, np.array([2.0, 2.0, 2.0, 4.0]))
    assert weighted.w1 == pytest.approx(repeated.w1)
    assert weighted.ks == pytest.approx(repeated.ks)
    assert weighted.bias == pytest.approx(repeated.bias)


def test_jax_arrays_and_pixels_of_no_weight_are_accepted():
    found = distances(
        jnp.arange(4.0), jnp.array([0.0, 3.0, jnp.nan]), jnp.array([1.0, 1.0, 0.0])
    )
    assert found.n_simulated == 2
    assert found.bias == pytest.approx(0.0)


def test_a_quantile_table_stands_for_its_pixels():
    pixels = np.random.default_rng(2).gamma(2.0, 3.0, 50_000)
    simulated = np.random.default_rng(3).gamma(2.5, 3.0, 20_000)
    table = quantiles(pixels)
    exact, reduced = distances(pixels, simulated), distances(table, simulated)
    assert table.values.shape == (1001,)
    assert reduced.n_observed == 50_000
    assert reduced.w1 == pytest.approx(exact.w1, rel=2e-3)
    assert reduced.ks == pytest.approx(exact.ks, abs=2e-3)
    # The last step of the table spans the whole tail, and the deviation feels it.
    assert reduced.std_observed == pytest.approx(exact.std_observed, rel=1e-2)
    assert distances(pixels, table).w1_over_std < 2e-3


def test_equal_observations_have_no_scale():
    found = distances(np.full(5, 2.0), np.full(3, 2.5))
    assert found.w1 == pytest.approx(0.5)
    assert math.isnan(found.w1_over_std)
    assert quantiles(np.full(5, 0.1)).values == pytest.approx(0.1)


NAN = math.nan


@pytest.mark.parametrize(
    ("values", "weights", "message"),
    [
        ([], None, "holds no pixels"),
        ([1.0, NAN], None, "not finite"),
        ([1.0, math.inf], None, "not finite"),
        ([1.0, 2.0], [0.0, 0.0], "holds no pixels"),
        ([1.0, 2.0], [1.0, NAN], "weights of the simulated sample"),
        ([1.0, 2.0], [1.0, -1.0], "weights of the simulated sample"),
        ([1.0, 2.0], [1.0], "2 values but 1 weights"),
    ],
)
def test_samples_without_meaning_are_refused(values, weights, message):
    weights = None if weights is None else np.array(weights)
    with pytest.raises(ValueError, match=message):
        distances(np.arange(3.0), np.array(values), weights)


@pytest.mark.parametrize(
    ("probabilities", "values"),
    [([], []), ([0.5, 0.2], [1.0, 2.0]), ([0.0, 1.0], [2.0, 1.0])],
)
def test_tables_that_are_no_quantiles_are_refused(probabilities, values):
    with pytest.raises(ValueError, match="quantile table"):
        Quantiles(np.array(probabilities), np.array(values), 10)


def test_sample_quantiles_are_weighted():
    sample = sample_of(np.array([3.0, 1.0, 2.0]), np.array([1.0, 8.0, 1.0]))
    assert sample.quantile(0.5) == 1.0
    assert sample.quantile(1.0) == 3.0
    assert sample.mean == pytest.approx(1.3)
