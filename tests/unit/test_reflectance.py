"""Derivatives of the plane-parallel slabs: right inside the domain, finite beyond."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np

from cloudjax import (
    AbstractPhase,
    DoubleHenyeyGreenstein,
    HenyeyGreenstein,
    PlaneParallel,
)


# co-albedo, asymmetry, depth, sun, view, scattering
NAMES = ("co_albedo", "asymmetry", "depth", "sun", "view", "scattering")


SURFACE = 0.3


def everything(model, co_albedo, phase, depth, sun, view, scattering):
    """All quantities of slabs of one material, [quantities slabs].

    `phase` is a phase function or an asymmetry.
    """
    if not isinstance(phase, AbstractPhase):
        phase = HenyeyGreenstein(phase)
    cloud = (depth, co_albedo, phase)
    surface = jnp.full(depth.shape, SURFACE)
    return jnp.stack(
        [
            model.reflectance(*cloud, sun, view, scattering),
            *model.albedo_and_transmittance(*cloud, sun),
            model.surface_share(*cloud, sun, view, surface),
        ]
    )


def random_slabs(count: int):
    rng = np.random.default_rng(1)
    co_albedo, g = 10 ** rng.uniform(-4, -0.5), rng.uniform(0.1, 0.88)
    depth = 10 ** rng.uniform(-1.5, 2, count)
    sun, view = rng.uniform(0.07, 1, (2, count))
    azimuth = np.pi * rng.random(count)
    sines = np.sqrt((1 - sun**2) * (1 - view**2))
    return co_albedo, g, depth, sun, view, sines * np.cos(azimuth) - sun * view


def test_float32_derivatives_are_central_differences():
    """Forward mode in float32 against differences in float64: 1e-3 of the largest.

    Of one quantity, over slabs; each slab's own argument is varied.
    """
    at = random_slabs(60)
    narrow = tuple(jnp.asarray(x, jnp.float32) for x in at)
    model = PlaneParallel.load()

    @jax.jit
    def derivative(direction):
        return jax.jvp(lambda *a: everything(model, *a), narrow, direction)[1]

    with jax.enable_x64(True):
        value = jax.jit(everything)
        wide = PlaneParallel.load()

    for argument, name in enumerate(NAMES):
        direction = [jnp.zeros_like(x) for x in narrow]
        direction[argument] = jnp.ones_like(narrow[argument])
        found = derivative(tuple(direction))
        step = 1e-5 * np.maximum(np.abs(at[argument]), 1e-2)
        with jax.enable_x64(True):
            ends = []
            for sign in (1, -1):
                moved = list(at)
                moved[argument] = moved[argument] + sign * step
                ends.append(value(wide, *(jnp.asarray(x, float) for x in moved)))
        expected = np.asarray(ends[0] - ends[1]) / (2 * step)
        scale = np.abs(expected) + 0.05 * np.abs(expected).max(axis=1, keepdims=True)
        assert np.max(np.abs(found - expected) / (scale + 1e-6)) < 1e-3, name


def test_forward_and_reverse_modes_agree_in_float32_at_the_size_of_a_tile():
    """jit(jacfwd) = jit(jacrev) by the material, summed over 3 x 2048 slabs."""
    co_albedo, g, *slabs = random_slabs(3 * 2048)
    model = PlaneParallel.load()
    slabs = [jnp.asarray(x, jnp.float32).reshape(3, 2048) for x in slabs]
    material = jnp.asarray([co_albedo, g], jnp.float32)

    def binned(material):
        co_albedo, phase = material[0], HenyeyGreenstein(material[1])
        values = model.reflectance(slabs[0], co_albedo, phase, *slabs[1:])
        levels = jnp.arange(1, 4)[:, None, None] / 4
        return jnp.mean(jax.nn.sigmoid((values[None] - levels) / 0.05), axis=(1, 2))

    forward = jax.jit(jax.jacfwd(binned))(material)
    reverse = jax.jit(jax.jacrev(binned))(material)
    assert np.abs(forward).min() > 0
    np.testing.assert_allclose(forward, reverse, rtol=1e-4, atol=1e-6)


def test_values_and_derivatives_are_finite_on_the_hard_set():
    """ω 0 and 1, g 0 to 0.99, τ 0 to 1e30, sun and viewer from horizon to zenith."""
    model = PlaneParallel.load()
    ends = (0.0, 0.5, 1.0)
    hard = itertools.product((0.0, 1e-30, 1e4, 1e30), ends, ends, (-1.0, 1.0))
    slabs = [jnp.asarray(x, jnp.float32) for x in zip(*hard, strict=True)]

    def total(*at):
        # Its derivatives are finite only if all are.
        values = everything(model, *at)
        return jnp.sum(values), values

    derivative = jax.jit(jax.value_and_grad(total, tuple(range(6)), has_aux=True))
    for material in itertools.product((0.0, 1.0), (0.0, 0.9, 0.99)):
        (_, values), slopes = derivative(*map(jnp.float32, material), *slabs)
        assert np.isfinite(values).all(), material
        assert float(values.min()) >= 0, material
        for name, slope in zip(NAMES, slopes, strict=True):
            assert np.isfinite(slope).all(), (material, name)


def test_no_cloud_shows_the_surface_alone():
    """Depth 0: nothing reflected, all transmitted, and the surface's own albedo."""
    model = PlaneParallel.load()
    phase = DoubleHenyeyGreenstein(*map(jnp.asarray, (0.85, -0.4, 0.95)))
    sun, view = jnp.asarray([0.1, 0.5, 1.0]), jnp.asarray([1.0, 0.05, 0.7])
    seen, reflected, through, share = jax.jit(everything)(
        model, jnp.asarray(0.01), phase, jnp.zeros(3), sun, view, -sun * view
    )
    assert not seen.any()
    assert not reflected.any()
    np.testing.assert_allclose(through, 1)
    np.testing.assert_allclose(share, SURFACE, rtol=1e-6)
