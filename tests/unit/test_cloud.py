"""The cloud function against eq. (1) written out, and its soft level set."""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import norm

from cloudjax import FractalCloud, Gaussian, Ladder
from cloudjax.clouds.fractal_samples import FractalSamples, Reading
from cloudjax.geometry.geodesy import ecef, geodetic
from cloudjax.geometry.path import Path, Profile
from cloudjax.geometry.shells import chords
from tests import hard_reference
from tests.helpers import (
    GEOSTATIONARY_M,
    FunctionMask,
    TurnedAir,
    cloud_function,
    fractal_cloud,
    geostationary_rays,
    limb_rays,
    rays_to,
    sampling,
    with_pixels,
)


_sampled = eqx.filter_jit(FractalCloud.sample)


def _flat(nodes=1, **changes) -> FractalCloud:
    """A cloud of two ladders of one rung each."""
    ladder = Ladder(Gaussian(), 10e3, 10e3)
    changes = {"gains": (1.0, 1.0)} | changes
    cloud = fractal_cloud(nodes=nodes)
    return dataclasses.replace(
        cloud, function=cloud_function(**changes), ladders=(ladder, ladder)
    )


NOTHING = (0.0, 0.0, 0.0)


def _samples(values, mask: Any = 0.0, altitude=2000.0, lost=(NOTHING, NOTHING)):
    """Over flat noise. `lost`: common, own and slope of each rung."""
    values = jnp.stack([jnp.asarray(v, float) for v in values], axis=1)
    like = jnp.ones_like(values[:, 0, 0])
    place = jnp.broadcast_to(jnp.asarray([1.0, 0.0, 0.0]), (len(like), 3))
    common, own, slope = (
        jnp.broadcast_to(jnp.asarray(part, float), (len(like), 2))
        for part in zip(*lost, strict=True)
    )
    return FractalSamples(
        path=Path(0 * like, altitude * like, 6.4e6 * like, -place, place),
        mask=Profile(mask * jnp.ones_like(values[:, 0])),
        values=(Reading(values, (0, 1)),),
        gradients=(Reading(jnp.zeros((len(like), 2, 3, 1)), (0, 1)),),
        common=common,
        own=own,
        slope=slope,
        up=jnp.ones((len(like), 3, 1)),
        at=None,
        steps=values.shape[-1],
    )


def _navigate(cloud, rays, mask=None, displacements=None, knots=2, width_m=0.0):
    if mask is not None:
        mask = FunctionMask(mask)
    cloud = dataclasses.replace(cloud, mask=mask, displacements=displacements)
    read = sampling(width_m, knots)
    return cloud.navigate(with_pixels(rays, width_m), chords(rays, cloud.shell), read)


def test_the_cloud_function_is_equation_1():
    """Against numpy in float64 at random weights, masks and altitudes.

    Ladders of two rungs and of one: persistences 0.6 and 0.7, gains 1, 1.1 and 0.9; the
    one of Worley noise is in two bands.
    """
    rng = np.random.default_rng(0)
    noise = rng.normal(size=(4, 30, 8))
    mask, z = rng.normal(size=(30, 8)), rng.uniform(500, 3500, (30, 8))
    cloud = fractal_cloud(mask_gain=0.7, barrier_strength=1.3, weights=(0.9, -0.4))
    below, above = np.exp(-(z - 1000) / 200), np.exp((z - 3000) / 200)
    first = 0.9 / np.hypot(1, 0.6)
    fractal = first * noise[0] + 0.6 * 1.1 * first * noise[1]
    fractal -= 0.9 * 0.4 * (noise[2] + noise[3])
    expected = fractal + 0.7 * mask - 1.3 * below - 1.3 * above - 0.2
    f, amplitudes = cloud.function, cloud.function.amplitudes(cloud.ladders)
    summed = jnp.zeros(np.shape(noise[0]))
    for a, x in zip(amplitudes, jnp.asarray(noise, float), strict=True):
        summed = summed + a * x
    found = f(summed, jnp.asarray(mask, float), jnp.asarray(z, float))
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("altitude", [-500.0, 2000.0, 16e3, 90e3, -6.4e6])
def test_far_outside_the_shell_all_is_finite_and_clear(altitude):
    z = jnp.full((1, 1), altitude)
    found, slope = jax.value_and_grad(lambda f: f(0 * z, 0 * z, z).sum())(
        cloud_function(barrier_scale_m=50.0)
    )
    assert jnp.isfinite(found)
    assert all(jnp.isfinite(leaf).all() for leaf in jax.tree.leaves(slope))
    assert (found > -1) == (altitude == 2000.0)


def test_the_gradient_in_space_is_that_of_the_differences():
    """Of the whole of eq. (1) along x, y and z, through navigation and noise.

    float64, half a metre either way; a few places in a hundred, where the difference
    spans a kink of the interpolation, are passed over.
    """
    with jax.enable_x64(True):
        cloud, rays = fractal_cloud(), geostationary_rays(200)
        here = _sampled(
            cloud, _navigate(cloud, rays), cloud.make_textures(), steps=3, slopes=True
        )
        chord, f = chords(rays, cloud.shell), cloud.function
        rise = f.rise(here.path.altitude_m(here.path.distance_m(3)))[:, 1]
        slopes = here.gradient(f.amplitudes(cloud.ladders))[..., 1]
        assert here.up is not None
        found = np.asarray(slopes + rise[None] * here.up[..., 1].T)
    middle, half = rays.at(chord.entry_m + chord.length_m / 2), np.eye(3) / 2
    ends = [
        hard_reference.cloud_function(cloud, middle + step)
        - hard_reference.cloud_function(cloud, middle - step)
        for step in half
    ]
    error = np.abs(found - np.stack(ends)).max(0)
    size = np.linalg.norm(found, axis=0)
    # A step averages over what is shorter: it takes 3 % of the shortest rung.
    assert np.median(error / size) < 0.05
    assert np.corrcoef(found.ravel(), np.stack(ends).ravel())[0, 1] > 0.99


def test_occupancy_is_a_gaussian_step_as_wide_as_the_smoothing():
    """Many rays of one step, along which CF does not change."""
    cloud = _flat(smoothing=0.3, threshold=0.0)
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
    cloud = _flat(nodes=5, smoothing=0.2, threshold=0.0)
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
    cloud = _flat(nodes=1, smoothing=0.2, threshold=0.0)
    values = np.linspace(-2, 2, 15)[:, None]
    samples = _samples([values, 0 * values], lost=((0.4, 0.1, 0.0), NOTHING))
    cf = values - 2 * np.exp(-5)
    np.testing.assert_allclose(
        cloud.occupancy(samples, 1).fraction[0],
        norm.cdf(cf / np.sqrt(0.2**2 + 0.5)),
        atol=1e-5,
    )


def test_the_change_within_a_step_makes_it_cloud_in_part():
    """The mean of Φ along a line, which changes as its neighbours do: by the harmonic
    mean of both changes, and half of it where they differ in sign.
    """
    cloud = _flat(smoothing=0.1, threshold=0.0)
    values = np.array([[-1.0, -0.5, 0.4, 0.5, 0.5, 0.1, 0.3]])
    change = np.array([0.5, 0.9 / 1.4, 0.18, 0.0, 0.0, 0.08 / 0.6, 0.2])
    cf = values[0] - 2 * np.exp(-5)
    along = (np.arange(2000) + 0.5) / 2000 - 0.5
    expected = norm.cdf((cf[:, None] + change[:, None] * along) / 0.1).mean(1)
    found = cloud.occupancy(_samples([values, 0 * values]), 7).fraction[0, 0]
    np.testing.assert_allclose(found, expected, atol=5e-5)


def test_no_step_beside_a_steep_barrier_is_cloud():
    """Where a barrier shuts, CF falls ever faster; a step that is clear at both ends
    stays clear, as thick cloud makes much of little.
    """
    cloud = _flat(smoothing=0.02, threshold=0.0)
    values = np.array([[0.8, 0.7, 0.2, -1.5, -9.0]])
    found = cloud.occupancy(_samples([values, 0 * values]), 5).fraction[0, 0]
    np.testing.assert_allclose(found[:2], 1, atol=1e-6)
    assert np.abs(found[3:]).max() < 1e-6


def test_a_level_set_that_cuts_a_step_fills_its_share_of_it():
    """A straight CF through zero: the cloud is as long as where CF is positive."""
    cloud = _flat(smoothing=0.0, threshold=0.0)
    for offset in np.linspace(0, 1, 7):
        cf = np.arange(-10.0, 10.0)[None] + offset + 2 * np.exp(-5)
        found = cloud.occupancy(_samples([cf, 0 * cf]), 20).fraction[0].sum()
        assert float(found) == pytest.approx(9.5 + offset, abs=1e-4)


def test_nodes_agree_when_nothing_is_lost():
    cloud = _flat(nodes=3, smoothing=0.1)
    values = np.linspace(-1, 1, 9)[:, None]
    fraction = cloud.occupancy(_samples([values, values]), 1).fraction
    np.testing.assert_allclose(fraction - fraction[:1], 0, atol=3e-5)


def test_a_level_set_without_any_width_is_hard_and_finite():
    """No smoothing, no footprint, no weights, and CF at the threshold or beside it."""
    cloud = _flat(smoothing=0.0, weights=(0.0, 0.0), threshold=0.0)
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
def test_the_likelihood_is_that_of_normal_noise(mask):
    """Against 1e5 draws of two ladders, in the middle between the barriers."""
    cloud = _flat()
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
    textures = cloud.make_textures()
    plain = _sampled(cloud, way, textures, steps=6, slopes=False)
    rich = _sampled(cloud, way, textures, steps=6, slopes=True)
    assert plain.up is None
    assert plain.gradients is None
    np.testing.assert_allclose(plain.mask.values, 2.0, atol=0.25)
    for one in jnp.eye(len(cloud.rungs)):
        np.testing.assert_allclose(
            plain.fractal(one, 6), rich.fractal(one, 6), atol=1e-5
        )
    assert np.all(np.asarray(way.entry) >= 0)
    assert np.all(np.asarray(way.entry) <= 1)


def test_wind_moves_the_noise_and_turns_its_gradients():
    """Air in solid rotation: the cloud is the still one, seen 2 degrees further on."""
    with jax.enable_x64(True):
        cloud = fractal_cloud()
        textures = cloud.make_textures()
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
        for one in jnp.eye(len(cloud.rungs)):
            np.testing.assert_allclose(
                moved.fractal(one, 4), still.fractal(one, 4), atol=1e-5
            )
            expected = np.einsum("ba,brs->ars", turn, still.gradient(one))
            # The strain of the map is that of a sphere: off by the flattening, 0.3 %.
            np.testing.assert_allclose(moved.gradient(one), expected, atol=1e-5)
            assert np.abs(expected).max() > 1e-4


def test_each_ladder_is_drawn_by_its_own_wind():
    """The first by no wind at all: it stays as it is in still air."""
    cloud, rays = fractal_cloud(), geostationary_rays(20)
    textures, maps = cloud.make_textures(), (None, TurnedAir.by(2.0))
    blown, still = (
        _sampled(cloud, way, textures, steps=4, slopes=True)
        for way in (_navigate(cloud, rays, None, maps), _navigate(cloud, rays))
    )
    for rung, one in zip(cloud.rungs, jnp.eye(len(cloud.rungs)), strict=True):
        off = np.abs(np.asarray(blown.fractal(one, 4) - still.fractal(one, 4))).max()
        assert (off < 1e-4) == (rung.ladder == 0)


def test_knots_follow_masks_that_bend_along_a_ray():
    """A mask quadratic in longitude along grazing chords of hundreds of kilometres.

    Between 2 knots it is off by the sagitta; between n + 1 knots by 1/n² of that.
    """
    cloud = fractal_cloud()
    longitude = 71.5 + np.linspace(0, 1, 20)
    ground = ecef(0 * longitude, longitude, 0 * longitude)
    rays = rays_to(GEOSTATIONARY_M, ground)
    textures = cloud.make_textures()
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


def test_air_that_stretches_noise_flattens_its_slopes():
    """A field twice as long in one direction, of which |∂x'/∂x|²/3 is left."""
    cloud = fractal_cloud()
    way = _navigate(cloud, geostationary_rays(3), width_m=5e3)
    half = jnp.broadcast_to(jnp.diag(jnp.asarray([0.5, 1.0, 1.0])), (3, 2, 3, 3))
    bent = eqx.tree_at(lambda w: w.strain, way, half, is_leaf=lambda x: x is None)
    textures = cloud.make_textures()
    still, moved = (
        _sampled(cloud, w, textures, steps=4, slopes=True) for w in (way, bent)
    )
    np.testing.assert_allclose(moved.slope, still.slope * 2.25 / 3, rtol=1e-5)
    assert float(still.slope.min()) > 0
    np.testing.assert_array_equal(moved.common, still.common)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"ladders": (Ladder(Gaussian(), 1e4, 5e3),)}, "give one of each per ladder"),
        ({"function": cloud_function(gains=(1.0, 1.0))}, "2 gains for ladders of 3"),
    ],
)
def test_ladders_weights_and_gains_must_match(changes, message):
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(fractal_cloud(), **changes)
