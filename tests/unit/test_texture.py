"""Textures: noise against independent implementations, and their average."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial import KDTree

from cloudjax import Footprint, InvertedWorley, Perlin, Texture, make_texture
from tests.helpers import pixel


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


@pytest.mark.parametrize("width", [0.02, 0.1, 0.3])
def test_the_lost_variance_is_what_averaging_removed(noise, width):
    """Of the interpolants, by random sampling: 4e5 points know a variance to 0.5 %."""
    u = _points(400_000)
    raw = np.asarray(_sample(make_texture(noise, 3, N), u), float)
    averaged = make_texture(noise, 3, N, footprint=pixel(width))
    removed = raw.var() - np.asarray(_sample(averaged, u), float).var()
    assert float(averaged.unresolved.variance) == pytest.approx(removed, abs=0.01)
    assert 0.002 < removed < 0.999


def test_the_lost_slopes_are_what_averaging_removed(noise):
    """Mean square of the gradient over its three components, per metre squared.

    Random points know a mean square to 1 %.
    """
    u, scale = _points(100_000), 20e3
    with_gradient = eqx.filter_jit(Texture.sample_with_gradient)
    raw = make_texture(noise, 3, N, length_scale_m=scale)
    averaged = make_texture(
        noise, 3, N, length_scale_m=scale, footprint=pixel(3e3, slant=0.5)
    )
    before, after = (
        (np.asarray(with_gradient(t, u)[1], float) ** 2).mean() / scale**2
        for t in (raw, averaged)
    )
    found = float(averaged.unresolved.slope)
    assert found == pytest.approx(before - after, rel=0.03)
    assert found > 0.2 * before


def test_no_footprint_loses_nothing(noise):
    texture = make_texture(noise, 3, N)
    for part in jax.tree.leaves(texture.unresolved):
        assert float(part) == pytest.approx(0, abs=1e-3)
    with_one = make_texture(noise, 3, N, footprint=pixel(1e-4))
    np.testing.assert_allclose(texture.voxels, with_one.voxels, atol=1e-5)


def test_a_footprint_of_many_periods_leaves_nothing(noise):
    texture = make_texture(noise, 3, N, footprint=pixel(50.0))
    np.testing.assert_allclose(texture.voxels, 0, atol=1e-5)
    assert float(texture.unresolved.variance) == pytest.approx(1, abs=1e-4)


@pytest.mark.parametrize("width", [0.2, 0.4])
def test_a_broad_average_has_few_voxels_and_the_same_values(noise, width, monkeypatch):
    """Of 4 voxels per width, against all 64 per period.

    At the nodes they agree to what the waves that are dropped have left; between them
    a straight line blunts 4 voxels per width by a tenth, which counts as lost.
    """
    few = make_texture(noise, 3, 64, footprint=pixel(width))
    monkeypatch.setattr("cloudjax.geometry.footprint._VOXELS_PER_WIDTH", 1e3)
    all_ = make_texture(noise, 3, 64, footprint=pixel(width))
    n = few.voxels.shape[0]
    assert 4 / width <= n < all_.voxels.shape[0]
    u = _points(20_000)
    fine = np.asarray(_sample(all_, u))
    assert (np.asarray(_sample(few, u)) - fine).std() < 0.12 * fine.std()
    assert float(few.unresolved.variance) == pytest.approx(
        float(all_.unresolved.variance), abs=0.05
    )


def test_the_average_is_gaussian_with_the_variances_of_a_box():
    """A wave shrinks by exp(-0.64 ((2πk₁w₁)² + ...)/24); as broad upwards as across."""
    fractal = Perlin(2, octaves=1)
    level = Footprint(0.1, 0.25)
    averaged = make_texture(fractal, 5, N, footprint=level)
    texture = make_texture(fractal, 5, N)
    before, after = (np.fft.fftn(np.asarray(t.voxels)) for t in (texture, averaged))
    for k in [(1, 0, 0), (0, 2, 1), (3, 1, 2), (0, 0, 2)]:
        waves = (k[0] * 0.25) ** 2 + (k[1] * 0.1) ** 2 + (k[2] * 0.1) ** 2
        expected = np.exp(-0.64 * (2 * np.pi) ** 2 * waves / 24)
        assert abs(after[k] / before[k]) == pytest.approx(expected, rel=1e-3)


def test_a_footprint_counts_in_periods(noise):
    one = make_texture(noise, 5, N, footprint=pixel(0.2))
    other = make_texture(noise, 5, N, length_scale_m=30e3, footprint=pixel(6e3))
    np.testing.assert_allclose(one.voxels, other.voxels, atol=1e-5)
    assert float(other.unresolved.slope) == pytest.approx(
        float(one.unresolved.slope) / 30e3**2, rel=1e-4
    )


def test_the_common_part_is_the_variance_of_the_means_along_rays(noise):
    """Of a field of the variance that is lost, over a way down a ray: 2e4 rays of 24
    points each.

    2e4 means know their variance to 1 %; the wave sum takes the field at its nodes, a
    straight line through them, and textures for alike in all directions.
    """
    width, slant, way = 0.25, 0.6, 0.3
    level = Footprint(width, width / slant)
    raw = make_texture(noise, 4, N)
    averaged = make_texture(noise, 4, N, footprint=level, way_m=way)
    assert averaged.voxels.shape == raw.voxels.shape
    before, after = (np.fft.fftn(np.asarray(t.voxels)) for t in (raw, averaged))
    transfer = np.abs(after) / np.maximum(np.abs(before), 1e-9)
    field = np.fft.ifftn(before * np.sqrt(1 - np.minimum(transfer, 1) ** 2)).real
    lost = eqx.tree_at(lambda t: t.voxels, raw, jnp.asarray(field, float))
    start = np.random.default_rng(1).random((3, 20_000, 1))
    along = way * (np.arange(24) + 0.5) / 24
    u = jnp.asarray(start + level.view[:, None, None] * along, float)
    values = np.asarray(_sample(lost, u), float)
    share = values.mean(-1).var() / values.var()
    found = float(averaged.unresolved.common)
    assert found / float(averaged.unresolved.variance) == pytest.approx(share, abs=0.1)
    assert 0.02 < share < 0.9


def test_the_longer_the_way_the_less_is_common(noise):
    level = Footprint(0.2, 0.2 / 0.6)
    ways = [
        make_texture(noise, 4, N, footprint=level, way_m=way).unresolved
        for way in (0.0, 0.1, 0.3, 1.0)
    ]
    common = [float(part.common) for part in ways]
    assert float(ways[0].own) == pytest.approx(0, abs=1e-6)
    assert common == sorted(common, reverse=True)
    assert common[-1] < 0.3 * common[0]
    for part in ways:
        assert float(part.variance) == pytest.approx(common[0], abs=1e-6)


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
