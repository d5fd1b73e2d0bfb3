"""Textures: noise against independent implementations, and their average."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial import KDTree

from cloudjax import InvertedWorley, Perlin, Texture, make_texture


NOISES = [Perlin(4, octaves=2), InvertedWorley(4)]
N = 16


@pytest.fixture(params=NOISES, ids=["perlin", "worley"])
def noise(request):
    return request.param


_sample = eqx.filter_jit(Texture.sample)


def _points(count: int, seed=0):
    return jnp.asarray(np.random.default_rng(seed).random((3, count)), float)


def test_textures_repeat_after_a_period(noise):
    texture = make_texture(noise, 1, N)
    u = jnp.round(_points(200) * 1024) / 1024  # exact under whole shifts
    for shift in ([1.0, 0, 0], [0, -1.0, 0], [2.0, -3.0, 1.0]):
        shifted = _sample(texture, u + jnp.asarray(shift)[:, None])
        np.testing.assert_array_equal(shifted, _sample(texture, u))


def test_nodes_carry_the_voxels(noise):
    texture = make_texture(noise, 1, N)
    index = np.stack(np.meshgrid(*[np.arange(N)] * 3, indexing="ij"))
    np.testing.assert_array_equal(
        _sample(texture, jnp.asarray(index / N)), texture.voxels
    )


# Mean of |F|, mean of F³ and one value, of seed 7 at 16 voxels per axis.
CHECKSUMS = {
    "Perlin": (0.926306, -0.147905, 1.669249),
    "InvertedWorley": (0.939087, 0.175730, 0.304366),
}


def test_a_seed_gives_the_same_texture_for_ever(noise):
    voxels = np.asarray(make_texture(noise, 7, N).voxels, float)
    found = np.abs(voxels).mean(), (voxels**3).mean(), voxels[3, 5, 9]
    np.testing.assert_allclose(found, CHECKSUMS[type(noise).__name__], atol=2e-5)
    other = np.asarray(make_texture(noise, 8, N).voxels)
    assert abs(np.corrcoef(voxels.ravel(), other.ravel())[0, 1]) < 0.3


def test_the_interpolant_has_mean_0_and_variance_1(noise):
    """Over all space, by exact quadrature, where the nodes alone have more."""
    texture = make_texture(noise, 2, N)
    node, weight = np.polynomial.legendre.leggauss(2)
    line = ((np.arange(N)[:, None] + (node + 1) / 2) / N).ravel()
    u = np.stack(np.meshgrid(line, line, line, indexing="ij"))
    values = np.asarray(texture.sample(jnp.asarray(u, float)), float)
    assert weight[0] == pytest.approx(weight[1])
    assert values.mean() == pytest.approx(0, abs=1e-5)
    assert values.var() == pytest.approx(1, abs=1e-5)
    assert np.var(np.asarray(texture.voxels)) > 1.05


def test_gradients_equal_differences_and_autodiff(noise):
    with jax.enable_x64(True):
        texture = make_texture(noise, 1, N)
        # Midway between nodes in each cell part, so that no difference spans a kink.
        u = (jnp.floor(_points(100) * N) + 0.1 + 0.8 * _points(100, 1)) / N
        value, gradient = eqx.filter_jit(texture.sample_with_gradient)(u)
        np.testing.assert_allclose(value, _sample(texture, u), rtol=1e-12, atol=1e-12)
        auto = jax.jit(jax.vmap(jax.grad(texture.sample), 1, 1))(u)
        np.testing.assert_allclose(gradient, auto, rtol=1e-9, atol=1e-9)
        ε = 1e-6
        for axis, step in enumerate(ε * jnp.eye(3)[..., None]):
            rise = _sample(texture, u + step) - _sample(texture, u - step)
            np.testing.assert_allclose(
                gradient[axis], rise / (2 * ε), rtol=1e-6, atol=1e-6
            )


def test_no_gradient_flows_into_the_voxels():
    texture = make_texture(NOISES[0], 1, N)
    slope = jax.grad(lambda t: t.sample(_points(10)).sum())(texture)
    np.testing.assert_array_equal(slope.voxels, 0)


@pytest.mark.parametrize("footprint", [0.02, 0.1, 0.3])
def test_the_lost_variance_is_what_averaging_removed(noise, footprint):
    """Of the interpolants, by random sampling: 4e5 points know a variance to 0.5 %."""
    u = _points(400_000)
    raw = np.asarray(_sample(make_texture(noise, 3, N), u), float)
    averaged = make_texture(noise, 3, N, footprint)
    removed = raw.var() - np.asarray(_sample(averaged, u), float).var()
    assert float(averaged.lost_variance) == pytest.approx(removed, abs=0.01)
    assert 0.003 < removed < 0.999


def test_no_footprint_loses_nothing(noise):
    texture = make_texture(noise, 3, N)
    assert float(texture.lost_variance) == 0
    with_one = make_texture(noise, 3, N, 1e-4)
    np.testing.assert_allclose(texture.voxels, with_one.voxels, atol=1e-5)


def test_a_footprint_of_many_periods_loses_everything(noise):
    texture = make_texture(noise, 3, N, 50.0)
    assert float(texture.lost_variance) == pytest.approx(1, abs=1e-5)
    np.testing.assert_allclose(texture.voxels, 0, atol=1e-5)


def test_the_average_is_gaussian_with_the_variance_of_a_box():
    """A wave exp(ikx) shrinks by exp(-k² w²/24)."""
    texture = make_texture(Perlin(2, octaves=1), 5, N)
    averaged = make_texture(Perlin(2, octaves=1), 5, N, 0.25)
    before, after = (np.fft.fftn(np.asarray(t.voxels)) for t in (texture, averaged))
    for k in [(1, 0, 0), (0, 2, 1), (3, 1, 2)]:
        expected = np.exp(-((2 * np.pi) ** 2) * sum(i**2 for i in k) * 0.25**2 / 24)
        assert abs(after[k] / before[k]) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("cells", [1, 2, 5])
def test_worley_noise_is_the_distance_to_the_nearest_point(cells):
    """Against a periodic k-d tree, in units of a cell.

    The noise looks one cell around, which is sure to hold the nearest point only if
    that is within one cell; further off it may be missed (measured: 1 node of 8000).
    """
    resolution = 20
    field = np.asarray(InvertedWorley(cells).field(11, resolution))
    shape = (cells,) * 3 + (3,)
    points = np.random.default_rng(11).random(shape, dtype=np.float32)
    corner = np.stack(np.meshgrid(*[np.arange(cells)] * 3, indexing="ij"), -1)
    places = ((corner + points.astype(float)) / cells).reshape(-1, 3) % 1
    tree = KDTree(places, boxsize=1)
    line = np.arange(resolution) / resolution
    nodes = np.stack(np.meshgrid(line, line, line, indexing="ij"), -1)
    distance, _ = tree.query(nodes.reshape(-1, 3))
    excess = -field.ravel() - distance * cells
    sure = distance * cells < 1
    np.testing.assert_allclose(excess[sure], 0, atol=1e-5)
    assert np.all(excess > -1e-5)
    assert np.mean(excess > 1e-5) < 1e-3


def test_perlin_noise_is_zero_at_the_nodes_of_its_lattice():
    field = np.asarray(Perlin(4, octaves=3).field(0, 32))
    np.testing.assert_allclose(field[::8, ::8, ::8], 0, atol=1e-6)
    assert np.abs(field).max() > 0.3


def test_perlin_noise_has_the_slope_of_its_lattice_vectors():
    """Near a node the noise rises as the random unit vector there does."""
    field = np.asarray(Perlin(2, octaves=1).field(4, 128), float)
    step = 2 / 128
    slopes = [
        (np.roll(field, -1, a) - np.roll(field, 1, a))[::64, ::64, ::64] / (2 * step)
        for a in range(3)
    ]
    length = np.sqrt(sum(s**2 for s in slopes))
    np.testing.assert_allclose(length, 1, atol=0.01)


def test_octaves_add_with_their_persistence():
    one = np.asarray(Perlin(2, octaves=1).field(9, N))
    two = np.asarray(Perlin(2, octaves=2, persistence=0.25).field(9, N))
    full = np.asarray(Perlin(2, octaves=2, persistence=1.0).field(9, N))
    np.testing.assert_allclose(two - one, 0.25 * (full - one), atol=1e-6)


@pytest.mark.parametrize("fractal", [Perlin(4, octaves=3), InvertedWorley(9)])
def test_voxels_too_few_for_the_cells_are_refused(fractal):
    with pytest.raises(ValueError, match="use at least two per cell"):
        make_texture(fractal, 0, N)
