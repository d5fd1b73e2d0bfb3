"""Light is found in the slabs that hold cloud; derivatives in all of them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax.light.reflectance import PlaneParallel
from cloudjax.light.reflection import Illumination, Returned, Scatterers, Slabs
from cloudjax.march import slabs
from cloudjax.march.slabs import in_slabs


BANDS, NODES, RAYS = 2, 3, 700


@pytest.fixture
def depth():
    """Four of five slabs are empty, and whole blocks of them."""
    rng = np.random.default_rng(0)
    filled = rng.random((NODES, RAYS)) < 0.2
    depth = np.where(filled, rng.exponential(3.0, filled.shape), 0.0)
    return jnp.asarray(np.stack([depth, 2 * depth]), float)


@pytest.fixture
def particles():
    return Scatterers(jnp.asarray([1e-5, 0.1]), jnp.asarray([0.85, 0.8]))


@pytest.fixture
def light():
    rng = np.random.default_rng(1)
    sun, view = (jnp.asarray(rng.uniform(0.2, 1, RAYS), float) for _ in range(2))
    return Illumination(None, None, sun, view, jnp.asarray(-sun * view))


def none(depth):
    return jax.vmap(Returned.by_none)(depth)


def plainly(strategy, depth, particles, light):
    return jax.vmap(strategy, in_axes=(0, 0, None))(depth, particles, light)


def test_slabs_with_cloud_are_those_of_the_strategy(depth, particles, light):
    assert depth[0].size > slabs._AT_ONCE
    strategy = Slabs(PlaneParallel.load())
    found = jax.jit(in_slabs)(strategy, depth, particles, light, none(depth))
    expected = plainly(strategy, depth, particles, light)
    for one, other in zip(
        jax.tree.leaves(found), jax.tree.leaves(expected), strict=True
    ):
        np.testing.assert_allclose(one, other, atol=3e-5)


def test_a_strategy_is_not_asked_about_slabs_without_cloud(depth, particles, light):
    def strategy(depth, particles, light):
        del particles, light
        return jnp.where(depth > 0, depth, jnp.nan)

    empty = jnp.full_like(depth, 7.0)
    found = in_slabs(strategy_of(strategy), depth, particles, light, empty)
    np.testing.assert_array_equal(found, jnp.where(depth > 0, depth, 7.0))


def strategy_of(function):
    """As arguments of what is differentiated, functions are trees without leaves."""
    return jax.tree_util.Partial(function)


def test_of_each_node_its_own_numbers_are_read(depth, particles, light):
    rng = np.random.default_rng(2)
    lit = jnp.asarray(rng.random((NODES, RAYS)), float)

    def strategy(depth, particles, light):
        return depth * light.lit * light.sun_height[None] + particles.asymmetry

    known = Illumination(
        lit, lit, light.sun_height, light.view_height, light.scattering
    )
    found = in_slabs(strategy_of(strategy), depth, particles, known, 0 * depth)
    expected = plainly(strategy, depth, particles, known)
    np.testing.assert_allclose(found, jnp.where(depth > 0, expected, 0.0), rtol=1e-6)


@pytest.mark.parametrize("empty", [True, False], ids=["clear", "cloudy"])
def test_derivatives_are_those_of_the_strategy_in_clear_air_too(
    depth, particles, light, empty
):
    """By the depth and by the particles, forwards and in reverse."""
    strategy = Slabs(PlaneParallel.load())
    depth = 0 * depth if empty else depth

    def sums(see, more, particles):
        seen = see(strategy, depth + more, particles, light)
        return sum(x.mean() for x in jax.tree.leaves(seen))

    def ours(strategy, depth, particles, light):
        return in_slabs(strategy, depth, particles, light, none(depth))

    start = jnp.asarray(0.0), particles
    for derivative in (jax.jacfwd, jax.grad):
        found, expected = (
            jax.jit(derivative(lambda *x, see=see: sums(see, *x), argnums=(0, 1)))(
                *start
            )
            for see in (ours, plainly)
        )
        for one, other in zip(
            jax.tree.leaves(found), jax.tree.leaves(expected), strict=True
        ):
            np.testing.assert_allclose(one, other, rtol=1e-4, atol=1e-6)
        assert abs(found[0]) > 0.1
