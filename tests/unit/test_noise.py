"""Noise against independent implementations, its interpolant, and its spectrum."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial import KDTree

from cloudjax import Gaussian, InvertedWorley, Perlin
from cloudjax.clouds.noise import VOXELS, WAVES, NoiseBands, bands, noise_bands


NOISES = (Gaussian(), Perlin(), InvertedWorley())
BANDS = (0, 1, 2, 3)  # the last two are of Worley noise
BAND = jnp.asarray(BANDS)


@pytest.fixture(params=NOISES, ids=["gaussian", "perlin", "worley"])
def noise(request):
    return request.param


_sample = eqx.filter_jit(NoiseBands.sample)


def _points(count: int, seed=0):
    """The same for every band."""
    u = np.random.default_rng(seed).random((3, 1, count))
    return jnp.asarray(np.repeat(u, len(BANDS), axis=1), float)


def _values(u):
    return np.asarray(_sample(noise_bands(NOISES), BAND, u), float)


def test_noise_repeats_after_a_period():
    u = jnp.round(_points(200) * 1024) / 1024  # exact under whole shifts
    for shift in ([1.0, 0, 0], [0, -1.0, 0], [2.0, -3.0, 1.0]):
        shifted = _values(u + jnp.asarray(shift)[:, None, None])
        np.testing.assert_array_equal(shifted, _values(u))


def test_nodes_carry_the_voxels():
    """Each band its own."""
    some = np.random.default_rng(1).integers(0, VOXELS, (3, 1, 50))
    found = _values(jnp.asarray(np.repeat(some, len(BANDS), axis=1) / VOXELS, float))
    every = [band.voxels for noise in NOISES for band in bands(noise)]
    for values, voxels in zip(found, every, strict=True):
        np.testing.assert_array_equal(values, voxels[tuple(some[:, 0])])


# Mean of |F|, mean of F³ and one value of all bands together.
CHECKSUMS = {
    "Gaussian": (0.844430, 0.013094, -1.229727),
    "Perlin": (0.842816, -0.028558, -0.305580),
    "InvertedWorley": (0.843168, 0.050956, -0.269129),
}


def test_noise_is_the_same_for_ever(noise):
    voxels = np.sum([band.voxels.astype(float) for band in bands(noise)], axis=0)
    found = np.abs(voxels).mean(), (voxels**3).mean(), voxels[3, 5, 9]
    np.testing.assert_allclose(found, CHECKSUMS[type(noise).__name__], atol=2e-5)


def test_the_interpolant_has_mean_0_and_variance_1(noise):
    """Over all space, by exact quadrature, where the nodes alone have more."""
    voxels = np.sum([band.voxels.astype(float) for band in bands(noise)], axis=0)
    square = np.zeros_like(voxels)
    node = (np.polynomial.legendre.leggauss(2)[0] + 1) / 2
    for place in np.ndindex(2, 2, 2):
        value = voxels
        for axis, i in enumerate(place):
            value = (1 - node[i]) * value + node[i] * np.roll(value, -1, axis)
        square += value**2 / 8
    assert voxels.mean() == pytest.approx(0, abs=1e-6)
    assert square.mean() == pytest.approx(1, abs=1e-5)
    assert voxels.var() > 1.02


def test_gradients_equal_differences_and_autodiff():
    with jax.enable_x64(True):
        noise = noise_bands(NOISES)
        # Midway between nodes in each cell part, so that no difference spans a kink.
        u = (jnp.floor(_points(100) * VOXELS) + 0.1 + 0.8 * _points(100, 1)) / VOXELS
        value, gradient = eqx.filter_jit(noise.sample_with_gradient)(BAND, u)
        np.testing.assert_allclose(value, _values(u), rtol=1e-6, atol=1e-6)
        auto = jax.jit(jax.grad(lambda at: noise.sample(BAND, at).sum()))(u)
        np.testing.assert_allclose(gradient, auto, rtol=1e-6, atol=1e-6)
        ε = 1e-6
        for axis, step in enumerate(ε * jnp.eye(3)[..., None, None]):
            rise = _values(u + step) - _values(u - step)
            np.testing.assert_allclose(
                gradient[axis], rise / (2 * ε), rtol=1e-5, atol=1e-5
            )


def test_no_gradient_flows_into_the_voxels():
    slope = jax.grad(lambda n: n.sample(BAND, _points(10)).sum())(noise_bands(NOISES))
    np.testing.assert_array_equal(slope.voxels, 0)


def test_gaussian_noise_has_its_spectrum():
    """cos²(π/2 log2(k/k0)) of power in equal parts of log k, and normal values.

    Of waves within an eighth of an octave: a few hundred of them know their power to a
    tenth; voxels blunt the shortest.
    """
    (band,) = bands(Gaussian())
    k = np.fft.fftfreq(VOXELS, 1 / VOXELS)
    octave = np.log2(np.sqrt(sum(a**2 for a in np.ix_(k, k, k))).clip(0.1) / WAVES)
    power = np.abs(np.fft.fftn(band.voxels)) ** 2
    edges = np.linspace(-0.8, 0.8, 13)
    found, _ = np.histogram(octave, edges, weights=power)
    middle = (edges[1:] + edges[:-1]) / 2
    expected = np.cos(np.pi / 2 * middle) ** 2
    np.testing.assert_allclose(
        found / found.sum(), expected / expected.sum(), atol=0.02
    )
    values = band.voxels / band.voxels.std()
    assert (values**4).mean() == pytest.approx(3, abs=0.15)


def test_worley_noise_is_the_distance_to_the_nearest_point():
    """Against a periodic k-d tree, in units of a cell.

    The noise looks one cell around, which is sure to hold the nearest point only if
    that is within one cell; further off it may be missed.
    """
    field = InvertedWorley().field(np.random.default_rng(11))
    points = np.random.default_rng(11).random((WAVES,) * 3 + (3,))
    corner = np.stack(np.meshgrid(*[np.arange(WAVES)] * 3, indexing="ij"), -1)
    tree = KDTree(((corner + points) / WAVES).reshape(-1, 3) % 1, boxsize=1)
    line = np.arange(VOXELS) / VOXELS
    nodes = np.stack(np.meshgrid(line, line, line, indexing="ij"), -1)
    distance, _ = tree.query(nodes.reshape(-1, 3))
    excess = -field.ravel() - distance * WAVES
    sure = distance * WAVES < 1
    np.testing.assert_allclose(excess[sure], 0, atol=1e-9)
    assert np.all(excess > -1e-9)
    assert np.mean(excess > 1e-9) < 1e-3


def test_the_bands_of_worley_noise_add_up_to_it():
    """Standardised, and cut where no wave is in both."""
    field = InvertedWorley().field(np.random.default_rng(2024))
    both = [band.voxels.astype(float) for band in bands(InvertedWorley())]
    assert np.corrcoef((both[0] + both[1]).ravel(), field.ravel())[0, 1] > 1 - 1e-9
    low, high = (np.abs(np.fft.fftn(band)) > 1e-2 for band in both)
    assert not np.any(low & high)


def test_perlin_noise_is_zero_at_the_nodes_of_its_lattice():
    field = Perlin().field(np.random.default_rng(0))
    step = VOXELS // WAVES
    np.testing.assert_allclose(field[::step, ::step, ::step], 0, atol=1e-12)
    assert np.abs(field).max() > 0.3


def test_perlin_noise_has_the_slope_of_its_lattice_vectors():
    """Near a node the noise rises as the random unit vector there does.

    One voxel of eight off, the fade has begun.
    """
    field = Perlin().field(np.random.default_rng(4))
    step = VOXELS // WAVES
    slopes = [
        (np.roll(field, -1, a) - np.roll(field, 1, a))[::step, ::step, ::step]
        for a in range(3)
    ]
    length = np.sqrt(sum(s**2 for s in slopes)) * step / 2
    np.testing.assert_allclose(length, 1, atol=0.2)


def test_the_nodes_of_a_spectrum_know_its_moments(noise):
    """Variance, and mean square of the gradient, by summing the waves up."""
    k = np.fft.fftfreq(VOXELS, 1 / VOXELS)
    square = (2 * np.pi) ** 2 * sum(a**2 for a in np.ix_(k, k, k))
    x, y, z = np.ix_(*[(2 + np.cos(2 * np.pi * k / VOXELS)) / 3] * 3)
    for band in bands(noise):
        power = np.abs(np.fft.fftn(band.voxels) / VOXELS**3) ** 2 * x * y * z
        assert band.powers.sum() == pytest.approx(power.sum(), rel=1e-5)
        found = band.powers @ band.wavenumbers**2
        assert found == pytest.approx((power * square).sum(), rel=1e-4)
