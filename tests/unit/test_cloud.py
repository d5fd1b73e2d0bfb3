"""The cloud function against eq. (1) written out, and its soft level set."""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import norm

from cloudjax import FractalCloud, Latent, Perlin, Shell
from cloudjax.cloud import FractalSamples
from tests.helpers import cloud_function, fractal_cloud, geostationary_rays


_sampled = eqx.filter_jit(FractalCloud.sample)


def _samples(cloud, values, mask: Any = 0.0, altitude=2000.0, lost=(0.0, 0.0)):
    values = [jnp.asarray(v, float) for v in values]
    like = jnp.ones_like(values[0])
    return FractalSamples(
        distance_m=like,
        altitude_m=altitude * like,
        mask=mask * like,
        texture_values=tuple(values),
        lost_variances=tuple(jnp.asarray(v, float) for v in lost),
        up=None,
        texture_gradients=None,
    )


def test_the_cloud_function_is_equation_1():
    """Against numpy in float64 at random weights, masks and altitudes."""
    rng = np.random.default_rng(0)
    textures = rng.normal(size=(2, 30, 8))
    mask, z = rng.normal(size=(30, 8)), rng.uniform(500, 3500, (30, 8))
    f = cloud_function(mask_gain=0.7, barrier_strength=1.3, weights=(0.9, -0.4))
    below, above = np.exp(-(z - 1000) / 200), np.exp((z - 3000) / 200)
    terms = 0.9 * textures[0] - 0.4 * textures[1] + 0.7 * mask
    expected = terms - 1.3 * below - 1.3 * above - 0.2
    arrays = [jnp.asarray(x, float) for x in (*textures, mask, z)]
    found = f((arrays[0], arrays[1]), arrays[2], arrays[3])
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("altitude", [-500.0, 2000.0, 16e3, 90e3, -6.4e6])
def test_far_outside_the_shell_all_is_finite_and_clear(altitude):
    z = jnp.full((1, 1), altitude)

    def value(f):
        return f((0 * z, 0 * z), 0 * z, z).sum()

    found, slope = jax.value_and_grad(value)(cloud_function(barrier_scale_m=50.0))
    assert jnp.isfinite(found)
    assert all(jnp.isfinite(leaf).all() for leaf in jax.tree.leaves(slope))
    assert (found > -1) == (altitude == 2000.0)


def test_the_gradient_in_space_is_that_of_the_differences():
    """Of the whole of eq. (1) along x, y and z, through navigation and textures.

    float64, half a metre either way; a few places in a hundred, where the difference
    spans a kink of the interpolation, are passed over.
    """
    with jax.enable_x64(True):
        cloud = fractal_cloud(Shell(500.0, 4000.0))
        textures = cloud.make_textures(0.0, 16)
        way = cloud.navigate(geostationary_rays(200))
        found, slopes = eqx.filter_jit(_both_slopes)(cloud, textures, way)
    error = np.abs(np.asarray(found - slopes)).max(0)
    size = np.linalg.norm(slopes, axis=0)
    assert np.median(error / size) < 1e-3
    assert np.mean(error / size < 1e-2) > 0.9


def _both_slopes(cloud, textures, way, step_m=0.5):
    """∇CF at the middle of each ray's chord, and central differences."""
    here = cloud.sample(way, textures, steps=3, with_gradient=True)
    f = cloud.function
    found = f.gradient(here.texture_gradients, here.altitude_m, here.up)[..., 1]
    middle = way.texture_entry + way.texture_change / 2
    zero = jnp.zeros_like(here.altitude_m[:, 1:2])

    def value(shift):
        values = [
            texture.sample(middle[:, i].T + shift[:, None] / cloud.length_scales_m[i])
            for i, texture in enumerate(textures)
        ]
        raised = here.altitude_m[:, 1] + shift @ here.up[..., 1]
        return f(tuple(v[:, None] for v in values), zero, raised[:, None])[:, 0]

    ends = jax.vmap(value)(step_m * jnp.concatenate([jnp.eye(3), -jnp.eye(3)]))
    return found, (ends[:3] - ends[3:]) / (2 * step_m)


def test_occupancy_is_a_gaussian_step_as_wide_as_the_smoothing():
    cloud = fractal_cloud(smoothing=0.3, threshold=0.0)
    values = np.linspace(-1.5, 1.5, 21)[None]
    found = eqx.filter_jit(cloud.occupancy)(_samples(cloud, [values, 0 * values]))
    barriers = 2 * np.exp(-5)
    np.testing.assert_allclose(
        found.fraction[0], norm.cdf((values - barriers) / 0.3), atol=1e-5
    )
    assert found.gradient is None


def test_the_lost_variance_widens_and_shifts_the_level_set():
    """σ² = s₀² + Σ m² v: a share shifts whole rays, the rest widens the step.

    Averaged over the nodes, both together are a step of the full width.
    """
    cloud = fractal_cloud(nodes=5, smoothing=0.2, threshold=0.0)
    values = np.linspace(-2, 2, 15)[None]
    samples = _samples(cloud, [values, 0 * values], lost=(0.5, 0.3))
    found = eqx.filter_jit(cloud.occupancy)(samples)
    lost = 1.0**2 * 0.5 + 0.5**2 * 0.3
    cf = values - 2 * np.exp(-5)
    node = np.asarray(cloud.latent.nodes, float)[:, None, None]
    width = np.sqrt(0.2**2 + 0.2 * lost)
    expected = norm.cdf((cf + node * np.sqrt(0.8 * lost)) / width)
    np.testing.assert_allclose(found.fraction, expected, atol=2e-5)
    mean = np.tensordot(np.asarray(found.weights), np.asarray(found.fraction), 1)
    full = norm.cdf(cf / np.sqrt(0.2**2 + lost))
    np.testing.assert_allclose(mean, full, atol=0.02)


def test_nodes_agree_when_nothing_is_lost():
    cloud = fractal_cloud(nodes=3, smoothing=0.1)
    values = np.linspace(-1, 1, 9)[None]
    fraction = cloud.occupancy(_samples(cloud, [values, values])).fraction
    np.testing.assert_allclose(fraction - fraction[:1], 0, atol=3e-5)


def test_a_level_set_without_any_width_is_hard_and_finite():
    """No smoothing, no footprint, no weights, and CF at the threshold or beside it."""
    cloud = fractal_cloud(smoothing=0.0, weights=(0.0, 0.0), threshold=0.0)
    masks = jnp.asarray([[-1.0, 0.0, 2 * np.exp(-5), 1.0]], float)

    def fractions(f):
        samples = _samples(cloud, [0 * masks, 0 * masks], masks)
        return dataclasses.replace(cloud, function=f).occupancy(samples).fraction[0, 0]

    found = jax.jit(fractions)(cloud.function)
    np.testing.assert_allclose(found[jnp.array([0, 1, 3])], [0, 0, 1], atol=1e-12)
    for leaf in jax.tree.leaves(jax.jit(jax.jacrev(fractions))(cloud.function)):
        assert jnp.isfinite(leaf).all()


def test_samples_hold_what_the_way_tells():
    cloud = fractal_cloud()
    rays = geostationary_rays(5)
    way = cloud.navigate(rays, mask=lambda latitude, longitude: latitude / 10)
    textures = cloud.make_textures(0.0, 16)
    plain = _sampled(cloud, way, textures, steps=6, with_gradient=False)
    rich = _sampled(cloud, way, textures, steps=6, with_gradient=True)
    assert plain.up is None
    assert plain.texture_gradients is None
    np.testing.assert_allclose(plain.mask, 2.0, atol=0.25)
    for a, b in zip(plain.texture_values, rich.texture_values, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-5)
    assert np.all(np.asarray(way.texture_entry) >= 0)
    assert np.all(np.asarray(way.texture_entry) <= 1)


class _Turned:
    """Solid air that came from two degrees further west."""

    def upwind(self, position):
        c, s = np.cos(np.radians(2)), np.sin(np.radians(2))
        return position @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def test_wind_moves_the_textures_and_turns_their_gradients():
    """Air in solid rotation: the cloud is the still one, seen 2 degrees further on."""
    with jax.enable_x64(True):
        cloud = fractal_cloud()
        textures = cloud.make_textures(0.0, 16)
        c, s = np.cos(np.radians(2)), np.sin(np.radians(2))
        turn = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])  # to the source
        rays = geostationary_rays(20)
        source = type(rays)(
            rays.origin_m @ turn.T, rays.direction @ turn.T, rays.pixel_rad
        )
        blown = cloud.navigate(rays, displacements=[_Turned(), _Turned()])
        moved = _sampled(cloud, blown, textures, steps=4, with_gradient=True)
        still = _sampled(
            cloud, cloud.navigate(source), textures, steps=4, with_gradient=True
        )
    assert moved.texture_gradients is not None
    assert still.texture_gradients is not None
    for i in range(2):
        np.testing.assert_allclose(
            moved.texture_values[i], still.texture_values[i], atol=1e-6
        )
        expected = np.tensordot(turn.T, np.asarray(still.texture_gradients[i]), 1)
        np.testing.assert_allclose(moved.texture_gradients[i], expected, atol=1e-8)


def test_textures_weights_and_scales_must_match():
    with pytest.raises(ValueError, match="give one of each per texture"):
        FractalCloud(
            cloud_function(),
            Latent.gauss_hermite(1),
            Shell(0.0, 1e3),
            (Perlin(2),),
            (1e4,),
        )
