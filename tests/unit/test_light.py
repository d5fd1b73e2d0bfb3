"""Strategies for sunlight: signs, limits and the hard set."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import Illumination, TwoFlux
from cloudjax.light.reflectance import PlaneParallel
from cloudjax.light.reflection import Scatterers, Slabs, slab
from tests.helpers import numbers


DEPTHS = [0.0, 1e-30, 1e-6, 1e-3, 1.0, 1e4, 1e10, 1e30]


@pytest.mark.parametrize("x64", [False, True])
def test_the_slab_is_finite_with_its_gradients(x64):
    with jax.enable_x64(x64):
        pairs = itertools.product(DEPTHS, [0.0, 1e-7, 1e-3, 0.5, 1.0])
        inputs = [jnp.asarray(x, float) for x in zip(*pairs, strict=True)]
        for jacobian in (jax.jacfwd, jax.jacrev):
            slope = jax.jit(jax.vmap(jacobian(slab, (0, 1))))(*inputs)
            assert all(jnp.isfinite(leaf).all() for leaf in jax.tree.leaves(slope))
        for value in jax.vmap(slab)(*inputs):
            assert jnp.all((value >= 0) & (value <= 1))


def test_the_slab_is_smooth_where_its_series_takes_over():
    with jax.enable_x64(True):
        co_albedo = jnp.asarray(0.01)
        switch = jnp.sqrt(1e-2 / (0.01 * 1.99))
        for side in (0, 1):
            low, high = (slab(switch * (1 + d), co_albedo)[side] for d in (-1e-9, 1e-9))
            assert abs(float(high - low)) < 5e-9


def _smooth(facing, height) -> Illumination:
    """A surface that has one slope, by the cosine n·s."""
    return _overhead(jnp.maximum(facing, 0), jnp.maximum(-facing, 0), height)


def _overhead(lit, shaded, height) -> Illumination:
    """Seen from straight above."""
    return Illumination(lit, shaded, height, jnp.ones_like(height), -height)


def _particles(co_albedo) -> Scatterers:
    return Scatterers(jnp.asarray(co_albedo, float), jnp.asarray(0.85, float))


def _factor(facing, height, depth=2.0, indirect=0.0, co_albedo=0.1):
    strategy = TwoFlux(jnp.asarray(indirect, float))
    found = strategy(
        numbers(depth)[None],
        _particles(co_albedo),
        _smooth(numbers(facing)[None], numbers(height)),
    )
    assert float(found.transmittance[0, 0]) == pytest.approx(np.exp(-depth))
    assert float(found.back[0, 0]) == 0
    return float(found.reflectance[0, 0])


@pytest.mark.parametrize("height", [0.0, -1e-6, -0.3, -1.0])
@pytest.mark.parametrize("facing", [-1.0, 0.0, 1.0])
def test_night_is_dark(height, facing):
    assert _factor(facing, height, indirect=0.5) == 0


def test_the_lit_side_reflects_and_the_far_side_transmits():
    reflected, transmitted = (
        float(x[0]) for x in slab(numbers(2.0), jnp.asarray(0.1, float))
    )
    assert _factor(0.6, 0.5) == pytest.approx(0.6 * reflected, rel=1e-6)
    scattered = transmitted - np.exp(-2.0)
    assert scattered > 0.05
    assert _factor(-0.6, 0.5) == pytest.approx(0.6 * scattered, rel=1e-5)
    assert _factor(0.0, 0.5) == 0


def test_a_rough_surface_reflects_and_transmits_at_once():
    reflected, transmitted = (
        float(x[0]) for x in slab(numbers(2.0), jnp.asarray(0.1, float))
    )
    light = _overhead(numbers(0.4)[None], numbers(0.2)[None], numbers(0.5))
    strategy = TwoFlux(jnp.asarray(0.0))
    found = strategy(numbers(2.0)[None], _particles(0.1), light)
    expected = 0.4 * reflected + 0.2 * (transmitted - np.exp(-2.0))
    assert float(found.reflectance[0, 0]) == pytest.approx(expected, rel=1e-5)


def test_indirect_light_comes_from_overhead():
    reflected = float(slab(numbers(2.0), jnp.asarray(0.1, float))[0][0])
    assert _factor(-1.0, 0.5, indirect=1.0) == pytest.approx(0.5 * reflected)
    mixed = 0.3 * 0.5 * reflected + 0.7 * 0.6 * reflected
    assert _factor(0.6, 0.5, indirect=0.3) == pytest.approx(mixed)


def _everything():
    """All depths, directions, sun heights and albedos of the hard set."""
    columns = zip(
        *itertools.product(
            DEPTHS, [0.0, 0.3, 1.0], [-1.0, -0.1, 0.0, 1.0], [-0.2, 0.0, 1e-12, 0.7]
        ),
        strict=True,
    )
    return [jnp.asarray(column, float) for column in columns]


def _one(depth, co_albedo, facing, height, indirect):
    strategy = TwoFlux(indirect)
    light = _smooth(facing[None, None], height[None])
    found = strategy(depth[None, None], _particles(co_albedo), light)
    return found.reflectance[0, 0]


def test_no_cloud_is_brighter_than_white_or_darker_than_black():
    inputs = [*_everything(), jnp.asarray(0.2)]
    found = jax.jit(jax.vmap(_one, (0, 0, 0, 0, None)))(*inputs)
    assert jnp.all((found >= 0) & (found <= 1))


def test_gradients_are_finite_up_to_the_terminator():
    slopes = jax.vmap(jax.grad(_one, range(5)), (0, 0, 0, 0, None))
    inputs = [*_everything(), jnp.asarray(0.2)]
    for slope in jax.jit(slopes)(*inputs):
        assert jnp.isfinite(slope).all()


# Slabs -------------------------------------------------------------------------------


def _slabs(depth, height, co_albedo):
    """What a slab seen from above reflects, leaves from behind, and sends back."""
    light = _smooth(jnp.ones_like(height)[None, None], height[None])
    found = Slabs(PlaneParallel.load())(depth[None, None], _particles(co_albedo), light)
    return [part[0, 0] for part in jax.tree.leaves(found)]


def test_no_slab_reflects_nothing_and_leaves_all():
    found = _slabs(jnp.asarray(0.0), jnp.asarray(0.7), 0.01)
    np.testing.assert_allclose(found, [0, 1, 0], atol=1e-5)


def test_an_endless_slab_hides_what_is_behind():
    """White, it is a little brighter than paper straight above and darker aslant."""
    reflected, through, back = _slabs(jnp.asarray(1e4), jnp.asarray(1.0), 0.0)
    assert 1.0 < float(reflected) < 1.2
    assert float(through) < 0.01
    assert float(back) == pytest.approx(1, abs=0.01)


def test_a_thin_white_slab_over_white_ground_stays_white():
    """All light returns, though not in all directions alike: within a tenth."""
    reflected, through, back = _slabs(jnp.asarray(3.0), jnp.asarray(0.8), 0.0)
    assert float(reflected + 0.8 * through / (1 - back)) == pytest.approx(0.8, rel=0.1)
