"""The cloud function against eq. (1) written out, and its soft level set."""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import norm

from cloudjax import FractalCloud, Latent, Perlin, Sampling, Shell
from cloudjax.clouds.fractal import FractalSamples
from cloudjax.clouds.texture import Unresolved
from cloudjax.geometry.footprint import POINT
from cloudjax.geometry.geodesy import ecef, geodetic
from cloudjax.geometry.path import Path, Profile
from cloudjax.geometry.shells import chords
from tests.helpers import (
    GEOSTATIONARY_M,
    FunctionMask,
    TurnedAir,
    cloud_function,
    fractal_cloud,
    geostationary_rays,
    limb_rays,
    pixel,
    rays_to,
)


_sampled = eqx.filter_jit(FractalCloud.sample)


NOTHING = (0.0, 0.0, 0.0)


def _samples(values, mask: Any = 0.0, altitude=2000.0, lost=(NOTHING, NOTHING)):
    """Over flat textures. `lost`: common, own and slope of each."""
    values = [jnp.asarray(v, float) for v in values]
    like = jnp.ones_like(values[0][:, 0])
    place = jnp.broadcast_to(jnp.asarray([1.0, 0.0, 0.0]), (len(like), 3))
    return FractalSamples(
        path=Path(0 * like, altitude * like, 6.4e6 * like, -place, place),
        mask=Profile(mask * jnp.ones_like(values[0])),
        texture_values=tuple(Profile(v) for v in values),
        unresolved=tuple(
            Unresolved(*(jnp.full(len(like), part) for part in parts)) for parts in lost
        ),
        up=jnp.ones((len(like), 3, 1)),
        texture_gradients=(jnp.zeros((len(like), 3, 1)),) * len(values),
        steps=values[0].shape[-1],
    )


def _navigate(cloud, rays, mask=None, displacements=None, knots=2):
    if mask is not None:
        mask = FunctionMask(mask)
    cloud = dataclasses.replace(cloud, mask=mask, displacements=displacements)
    sampling = Sampling(POINT, knots, knots)
    return cloud.navigate(rays, chords(rays, cloud.shell), sampling)


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
    found = f(f.fractal((arrays[0], arrays[1])), arrays[2], arrays[3])
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("altitude", [-500.0, 2000.0, 16e3, 90e3, -6.4e6])
def test_far_outside_the_shell_all_is_finite_and_clear(altitude):
    z = jnp.full((1, 1), altitude)

    def value(f):
        return f(f.fractal((0 * z, 0 * z)), 0 * z, z).sum()

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
        textures = cloud.make_textures(POINT, 16)
        way = _navigate(cloud, geostationary_rays(200))
        found, slopes = eqx.filter_jit(_both_slopes)(cloud, textures, way)
    error = np.abs(np.asarray(found - slopes)).max(0)
    size = np.linalg.norm(slopes, axis=0)
    assert np.median(error / size) < 1e-3
    assert np.mean(error / size < 1e-2) > 0.9


def _both_slopes(cloud, textures, way, step_m=0.5):
    """∇CF at the middle of each ray's chord, and central differences."""
    here = cloud.sample(way, textures, steps=3, slopes=True)
    f = cloud.function
    altitude = here.path.altitude_m(here.path.distance_m(3))
    up = here.up[..., 1].T
    rise = f.rise(altitude)[None, :, 1] * up
    gradients = tuple(jnp.moveaxis(g, 1, 0) for g in here.texture_gradients)
    found = f.gradient(gradients)[..., 1] + rise
    middle = way.texture_entry + way.texture_change[..., 0] / 2
    zero = jnp.zeros_like(altitude[:, 1:2])

    def value(shift):
        values = [
            texture.sample(middle[:, i].T + shift[:, None] / cloud.length_scales_m[i])
            for i, texture in enumerate(textures)
        ]
        raised = altitude[:, 1] + shift @ up
        fractal = f.fractal(tuple(v[:, None] for v in values))
        return f(fractal, zero, raised[:, None])[:, 0]

    ends = jax.vmap(value)(step_m * jnp.concatenate([jnp.eye(3), -jnp.eye(3)]))
    return found, (ends[:3] - ends[3:]) / (2 * step_m)


def test_occupancy_is_a_gaussian_step_as_wide_as_the_smoothing():
    """Many rays of one step, along which CF does not change."""
    cloud = fractal_cloud(smoothing=0.3, threshold=0.0)
    values = np.linspace(-1.5, 1.5, 21)[:, None]
    found = eqx.filter_jit(cloud.occupancy)(_samples([values, 0 * values]), 1)
    barriers = 2 * np.exp(-5)
    np.testing.assert_allclose(
        found.fraction[0], norm.cdf((values - barriers) / 0.3), atol=1e-5
    )


def test_the_lost_variance_shifts_and_widens_the_level_set():
    """The common part shifts whole rays, s₀² and the own part widen the step.

    Averaged over the nodes, both together are a step of the full width.
    """
    cloud = fractal_cloud(nodes=5, smoothing=0.2, threshold=0.0)
    values = np.linspace(-2, 2, 15)[:, None]
    samples = _samples([values, 0 * values], lost=((0.4, 0.1, 3e-9), (0.1, 0.2, 4e-9)))
    found = eqx.filter_jit(cloud.occupancy)(samples, 1)
    common, own = 0.4 + 0.5**2 * 0.1, 0.1 + 0.5**2 * 0.2
    cf = values - 2 * np.exp(-5)
    node = np.asarray(cloud.latent.nodes, float)[:, None, None]
    expected = norm.cdf((cf + node * np.sqrt(common)) / np.sqrt(0.2**2 + own))
    np.testing.assert_allclose(found.fraction, expected, atol=2e-5)
    mean = np.tensordot(np.asarray(found.weights), np.asarray(found.fraction), 1)
    full = norm.cdf(cf / np.sqrt(0.2**2 + common + own))
    np.testing.assert_allclose(mean, full, atol=0.02)
    assert found.slopes is not None
    np.testing.assert_allclose(found.slopes.unresolved, 4e-9, rtol=1e-5)


def test_a_single_node_takes_all_that_is_lost_for_width():
    cloud = fractal_cloud(nodes=1, smoothing=0.2, threshold=0.0)
    values = np.linspace(-2, 2, 15)[:, None]
    samples = _samples([values, 0 * values], lost=((0.4, 0.1, 0.0), NOTHING))
    cf = values - 2 * np.exp(-5)
    np.testing.assert_allclose(
        cloud.occupancy(samples, 1).fraction[0],
        norm.cdf(cf / np.sqrt(0.2**2 + 0.5)),
        atol=1e-5,
    )


def test_the_change_within_a_step_widens_the_level_set():
    """σ² = s₀² + (change of CF in the step)²/12, by differences of the neighbours."""
    cloud = fractal_cloud(smoothing=0.1, threshold=0.0)
    values = np.array([[-1.0, -0.5, 0.4, 0.5, 0.5]])
    change = np.array([[0.5, 0.7, 0.5, 0.05, 0.0]])
    cf = values - 2 * np.exp(-5)
    np.testing.assert_allclose(
        cloud.occupancy(_samples([values, 0 * values]), 5).fraction[0],
        norm.cdf(cf / np.sqrt(0.1**2 + change**2 / 12)),
        atol=1e-5,
    )


def test_a_level_set_that_cuts_a_step_fills_its_share_of_it():
    """A straight CF through zero: the cloud is as long as where CF is positive.

    Width and mean of a step are those of a box. Its Gaussian leaves a ripple: the first
    wave of the sum over steps is exp(-2π²/12)/π = 0.061 of a step.
    """
    cloud = fractal_cloud(smoothing=0.0, threshold=0.0)
    for offset in np.linspace(0, 1, 7):
        cf = np.arange(-10.0, 10.0)[None] + offset + 2 * np.exp(-5)
        found = cloud.occupancy(_samples([cf, 0 * cf]), 20).fraction[0].sum()
        assert float(found) == pytest.approx(9.5 + offset, abs=0.062)


def test_nodes_agree_when_nothing_is_lost():
    cloud = fractal_cloud(nodes=3, smoothing=0.1)
    values = np.linspace(-1, 1, 9)[:, None]
    fraction = cloud.occupancy(_samples([values, values]), 1).fraction
    np.testing.assert_allclose(fraction - fraction[:1], 0, atol=3e-5)


def test_a_level_set_without_any_width_is_hard_and_finite():
    """No smoothing, no footprint, no weights, and CF at the threshold or beside it."""
    cloud = fractal_cloud(smoothing=0.0, weights=(0.0, 0.0), threshold=0.0)
    masks = jnp.asarray([-1.0, 0.0, 2 * np.exp(-5), 1.0], float)[:, None]

    def fractions(f):
        samples = _samples([0 * masks, 0 * masks], masks)
        changed = dataclasses.replace(cloud, function=f)
        return changed.occupancy(samples, 1).fraction[0, :, 0]

    found = jax.jit(fractions)(cloud.function)
    np.testing.assert_allclose(found[jnp.array([0, 1, 3])], [0, 0, 1], atol=1e-12)
    for leaf in jax.tree.leaves(jax.jit(jax.jacrev(fractions))(cloud.function)):
        assert jnp.isfinite(leaf).all()


@pytest.mark.parametrize("mask", [-4.0, -2.0, 0.0, 2.0])
def test_the_likelihood_is_that_of_normal_textures(mask):
    """Against 1e5 draws of two textures, in the middle between the barriers."""
    cloud = fractal_cloud(Shell(500.0, 4000.0))
    f, draws = cloud.function, np.random.default_rng(2).normal(size=(2, 100_000))
    z = jnp.full((1, 1), (float(f.base_m) + float(f.top_m)) / 2)
    weights = np.asarray(f.weights)
    sure = float(f(0 * z, jnp.full((1, 1), mask), z)[0, 0])
    cover = np.mean(sure + weights @ draws > 0)
    way = _navigate(cloud, geostationary_rays(3), lambda φ, λ: 0 * φ + mask)
    np.testing.assert_allclose(cloud.likelihood(way), cover, atol=0.01)


def test_a_ray_past_the_shell_meets_nothing():
    cloud = fractal_cloud(threshold=-50.0)
    past = limb_rays(30e3)
    assert float(cloud.likelihood(_navigate(cloud, past))[0]) == 0


def test_samples_hold_what_the_way_tells():
    cloud = fractal_cloud()
    rays = geostationary_rays(5)
    way = _navigate(cloud, rays, lambda latitude, longitude: latitude / 10)
    textures = cloud.make_textures(POINT, 16)
    plain = _sampled(cloud, way, textures, steps=6, slopes=False)
    rich = _sampled(cloud, way, textures, steps=6, slopes=True)
    assert plain.up is None
    assert plain.texture_gradients is None
    np.testing.assert_allclose(plain.mask.values, 2.0, atol=0.25)
    for a, b in zip(plain.texture_values, rich.texture_values, strict=True):
        np.testing.assert_allclose(a.values, b.values, atol=1e-5)
    assert np.all(np.asarray(way.texture_entry) >= 0)
    assert np.all(np.asarray(way.texture_entry) <= 1)


def test_wind_moves_the_textures_and_turns_their_gradients():
    """Air in solid rotation: the cloud is the still one, seen 2 degrees further on."""
    with jax.enable_x64(True):
        cloud = fractal_cloud()
        textures = cloud.make_textures(POINT, 16)
        c, s = np.cos(np.radians(2)), np.sin(np.radians(2))
        turn = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])  # to the source
        rays = geostationary_rays(20)
        source = type(rays)(
            rays.origin_m @ turn.T, rays.direction @ turn.T, rays.pixel_rad
        )
        air = TurnedAir.by(2.0)
        blown = _navigate(cloud, rays, None, (air, air))
        moved = _sampled(cloud, blown, textures, steps=4, slopes=True)
        still = _sampled(
            cloud, _navigate(cloud, source), textures, steps=4, slopes=True
        )
    assert moved.texture_gradients is not None
    assert still.texture_gradients is not None
    for i in range(2):
        np.testing.assert_allclose(
            moved.texture_values[i].values, still.texture_values[i].values, atol=1e-6
        )
        expected = turn.T @ np.asarray(still.texture_gradients[i])
        # The strain of the map is that of a sphere: off by the flattening of 0.3 %.
        np.testing.assert_allclose(moved.texture_gradients[i], expected, atol=1e-7)


def test_knots_follow_masks_that_bend_along_a_ray():
    """A mask quadratic in longitude along grazing chords of hundreds of kilometres.

    Between 2 knots it is off by the sagitta; between n + 1 knots by 1/n² of that.
    """
    cloud = fractal_cloud()
    longitude = 71.5 + np.linspace(0, 1, 20)
    ground = ecef(0 * longitude, longitude, 0 * longitude)
    rays = rays_to(GEOSTATIONARY_M, ground)
    textures = cloud.make_textures(POINT, 16)
    middles = chords(rays, cloud.shell)
    along = middles.length_m[:, None] * (np.arange(32) + 0.5) / 32
    place = (
        rays.origin_m[:, None]
        + rays.direction[:, None] * (middles.entry_m[:, None] + along)[..., None]
    )
    truth = _bent(*geodetic(place)[:2])
    errors = []
    for knots in (2, 3, 5):
        way = _navigate(cloud, rays, _bent, knots=knots)
        samples = _sampled(cloud, way, textures, steps=32, slopes=False)
        found = np.asarray(samples.mask.in_steps(32))
        errors.append(np.abs(found - truth).max())
    assert errors[0] > 1e-3
    assert errors[1] < errors[0] / 3
    assert errors[2] < errors[1] / 3


def _bent(latitude, longitude):
    return 30 * (longitude - 72) ** 2


def test_air_that_stretches_a_texture_flattens_its_slopes():
    """A field twice as long in one direction, of which |∂x'/∂x|²/3 is left."""
    cloud = fractal_cloud()
    way = _navigate(cloud, geostationary_rays(3))
    half = jnp.broadcast_to(jnp.diag(jnp.asarray([0.5, 1.0, 1.0])), (3, 2, 3, 3))
    bent = eqx.tree_at(lambda w: w.strain, way, half, is_leaf=lambda x: x is None)
    textures = cloud.make_textures(pixel(5e3), 16)
    still, moved = (
        _sampled(cloud, w, textures, steps=4, slopes=True) for w in (way, bent)
    )
    for a, b in zip(still.unresolved, moved.unresolved, strict=True):
        np.testing.assert_allclose(b.slope, a.slope * 2.25 / 3, rtol=1e-5)
        assert float(a.slope[0]) > 0
        np.testing.assert_array_equal(b.common, a.common)


def test_textures_weights_and_scales_must_match():
    with pytest.raises(ValueError, match="give one of each per texture"):
        FractalCloud(
            function=cloud_function(),
            latent=Latent.gauss_hermite(1),
            shell=Shell(0.0, 1e3),
            fractals=(Perlin(2),),
            length_scales_m=(1e4,),
        )
