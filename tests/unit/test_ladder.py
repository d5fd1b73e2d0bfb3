"""Ladders: their rungs, and what pixels leave of them."""

import math
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import erf

from cloudjax import Gaussian, InvertedWorley, Ladder, Perlin
from cloudjax.clouds.ladder import (
    EVERY_STEP,
    amplitudes,
    common_share,
    frames,
    kept,
    rungs,
)
from cloudjax.clouds.noise import bands, noise_bands
from cloudjax.geometry.footprint import Footprint
from tests.helpers import sampling


NOISES = (Gaussian(), Perlin(), InvertedWorley())
BAND = {"gaussian": 0, "perlin": 1, "worley": 2}


def _spectrum(noise, period_m=1.0):
    """Of the first band, as arrays of one rung."""
    band = bands(noise)[0]
    k = jnp.asarray(band.wavenumbers[None] / period_m, float)
    return k, jnp.asarray(band.powers[None], float)


def _pixel(across, along):
    return Footprint(jnp.asarray([across], float), jnp.asarray([along], float))


def test_rungs_are_an_octave_apart():
    assert Ladder(Gaussian(), 8e3, 1e3).wavelengths_m == (8e3, 4e3, 2e3, 1e3)
    assert Ladder(Perlin(), 8e3, 1001.0).wavelengths_m == (8e3, 4e3, 2e3)
    assert Ladder(Gaussian(), 8e3, 8e3).wavelengths_m == (8e3,)


def test_rungs_of_worley_noise_are_two_octaves_apart_in_two_bands():
    ladder = Ladder(InvertedWorley(), 8e3, 1e3)
    assert ladder.wavelengths_m == (8e3, 2e3)
    found = [(r.step, r.octave, r.band) for r in rungs((ladder,))]
    assert found == [(0, 0, 0), (0, 0, 1), (1, 2, 0), (1, 2, 1)]


@pytest.mark.parametrize("span", [(1e3, 2e3), (1e3, 0.5), (5e7, 1e3)])
def test_wavelengths_that_make_no_ladder_are_refused(span):
    with pytest.raises(ValueError, match="shortest_m must be 1 or more"):
        Ladder(Gaussian(), *span)


def test_amplitudes_have_the_weight_together_and_fall_by_the_persistence():
    ladders = Ladder(Gaussian(), 8e3, 1e3), Ladder(InvertedWorley(), 8e3, 1e3)
    found = amplitudes(
        ladders, jnp.asarray([1.5, 0.5]), jnp.asarray([0.6, 0.8]), jnp.ones(6)
    )
    first, second = np.asarray(found[:4]), np.asarray(found[4::2])
    assert np.linalg.norm(first) == pytest.approx(1.5, rel=1e-6)
    np.testing.assert_allclose(first[1:] / first[:-1], 0.6, rtol=1e-6)
    assert np.linalg.norm(second) == pytest.approx(0.5, rel=1e-6)
    assert second[1] / second[0] == pytest.approx(0.8**2, rel=1e-6)
    # Both bands of a rung have its amplitude.
    np.testing.assert_array_equal(found[4::2], found[5::2])


def test_a_gain_is_that_of_its_step():
    ladders = (Ladder(InvertedWorley(), 8e3, 1e3),)
    one, persistence = jnp.ones(1), jnp.full(1, 0.5)
    plain = amplitudes(ladders, one, persistence, jnp.ones(2))
    raised = amplitudes(ladders, one, persistence, jnp.asarray([1.0, 3.0]))
    ratio = np.asarray(raised) / np.asarray(plain)
    np.testing.assert_allclose(ratio, [1, 1, 3, 3], rtol=1e-6)


def test_rungs_are_turned_and_shifted_each_on_its_own():
    """By rotations over the period, and longer ladders have the same first rungs."""
    ladder = Ladder(Gaussian(), 8e3, 1e3)
    turned, shifts = frames((ladder,), 5)
    for one, rung in zip(turned.astype(float), rungs((ladder,)), strict=True):
        rotation = one * rung.period_m
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-6)
        assert np.linalg.det(rotation) == pytest.approx(1, abs=1e-6)
    assert len(np.unique(shifts)) == shifts.size
    longer = frames((Ladder(Gaussian(), 8e3, 100.0),), 5)
    np.testing.assert_array_equal(longer[0][:4], turned)
    np.testing.assert_array_equal(longer[1][:4], shifts)
    assert np.abs(frames((ladder,), 6)[0] - turned).max() > 1e-6


@pytest.mark.parametrize("name", BAND)
@pytest.mark.parametrize(("across", "along"), [(0.01, 0.01), (0.02, 0.05), (0.03, 0.1)])
def test_the_amplitude_is_what_an_average_leaves(name, across, along):
    """The variance of a Gaussian average of the noise, all directions of its long axis
    together, by Fourier transform in periods.

    Tolerance: 0.03 of the variance, for three nodes of the spectrum, a rational form of
    the error function and the thousandth that is left out.
    """
    noise = NOISES[BAND[name]]
    band = bands(noise)[0]
    n = band.voxels.shape[0]
    k = 2 * np.pi * np.fft.fftfreq(n, 1 / n)
    square = sum(a**2 for a in np.ix_(k, k, k))
    power = np.abs(np.fft.fftn(band.voxels) / n**3) ** 2
    # The mean over directions of exp(-k²(σw² + (σl² - σw²) cos²)).
    q = np.sqrt(np.maximum(square * (along**2 - across**2), 1e-12))
    share = np.exp(-square * across**2) * np.sqrt(np.pi) / 2 * erf(q) / q
    expected = (power * share).sum() / power.sum()
    amplitude, lost, _ = kept(*_spectrum(noise), _pixel(across, along))
    assert float(amplitude[0, 0] ** 2) == pytest.approx(expected, abs=0.03)
    whole = float(band.powers.sum())
    assert float(lost[0, 0]) == pytest.approx(whole * (1 - expected), abs=0.03)


def test_an_average_over_a_pixel_by_hand():
    """Of Gaussian noise along one axis, by many points, against the closed form.

    2e4 points know a variance to 1 %.
    """
    across = 0.012
    noise, band = noise_bands(NOISES), jnp.zeros(1, int)
    rng = np.random.default_rng(0)
    centre = rng.random((3, 1, 20_000, 1))
    around = across * rng.standard_normal((3, 1, 1, 200))
    values = eqx.filter_jit(noise.sample)(band, jnp.asarray(centre + around, float))
    found = float(np.asarray(values, float).mean(-1).var())
    amplitude, *_ = kept(*_spectrum(Gaussian()), _pixel(across, across))
    assert found == pytest.approx(float(amplitude[0, 0] ** 2), abs=0.02)


def test_no_pixel_loses_nothing_and_a_broad_one_everything():
    k, powers = _spectrum(Gaussian(), 1e3)
    amplitude, lost, slope = kept(k, powers, _pixel(0.0, 0.0))
    assert float(amplitude[0, 0]) == pytest.approx(1, abs=1e-3)
    assert float(lost[0, 0]) == pytest.approx(0, abs=2e-3)
    assert float(slope[0, 0]) == pytest.approx(0, abs=1e-9)
    amplitude, lost, slope = kept(k, powers, _pixel(5e3, 9e3))
    assert float(amplitude[0, 0]) == 0
    assert float(lost[0, 0]) == pytest.approx(1, abs=1e-6)
    steepness = float((powers * k**2).sum() / 3)
    assert float(slope[0, 0]) == pytest.approx(steepness, rel=1e-5)


def test_derivatives_are_finite_where_a_rung_fades():
    k, powers = _spectrum(Gaussian(), 1e3)

    def amplitude(across):
        return kept(k, powers, Footprint(across, 2 * across))[0].sum()

    slopes = jax.jit(jax.grad(amplitude))(jnp.linspace(0.0, 500.0, 400))
    assert np.isfinite(np.asarray(slopes)).all()


def test_a_rung_that_is_not_read_has_nothing_left():
    """`points` is 0 just where the narrowest of the pixels leaves no amplitude."""
    (rung,) = rungs((Ladder(Gaussian(), 1e3, 1e3),))
    for width in np.geomspace(100, 1e4, 40):
        read = rung.points(sampling(width), 1500.0)
        pixel = Footprint.level(jnp.asarray([width]), jnp.ones(1))
        k, powers = _spectrum(Gaussian(), rung.period_m)
        assert (read > 0) == bool(kept(k, powers, pixel)[0][0, 0] > 0)


def test_a_rung_is_read_the_more_often_the_shorter_it_is_and_the_pixel():
    ladder = rungs((Ladder(Gaussian(), 64e3, 500.0),))
    near = [rung.points(sampling(20.0), 1500.0) for rung in ladder]
    assert near == sorted(near)
    assert near[0] <= 2
    assert near[-1] >= 64
    far = [rung.points(sampling(2e3), 1500.0) for rung in ladder]
    assert max(far) <= 2
    assert far[-1] == 0
    at_limb = replace(sampling(2e3, knots=9), stretch=math.inf)
    assert {rung.points(at_limb, 1500.0) for rung in ladder} == {0, EVERY_STEP}


def test_the_common_share_is_the_variance_of_means_along_rays():
    """Of Gaussian noise: 2e4 stretches of 24 points each, in wavelengths.

    Tolerance: 0.06, for one formula serves all lengths.
    """
    noise, band = noise_bands(NOISES), jnp.zeros(1, int)
    start = np.random.default_rng(1).random((3, 1, 20_000, 1))
    for stretch in (0.2, 0.5, 1.0, 3.0):
        along = stretch / 8 * (np.arange(24) + 0.5) / 24
        u = start + np.array([0.6, 0.0, 0.8])[:, None, None, None] * along
        values = eqx.filter_jit(noise.sample)(band, jnp.asarray(u, float))
        share = float(np.asarray(values, float).mean(-1).var())
        found = common_share(jnp.ones(1), stretch / 0.35, jnp.ones(1))
        assert float(found[0, 0]) == pytest.approx(share, abs=0.06)
