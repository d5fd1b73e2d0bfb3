"""The light of a point along a line of sight, against quadrature."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad

from cloudjax.light.point_source import point_light


RNG = np.random.default_rng(0)
CAMERA, SOURCE = RNG.normal(size=(2, 8, 3)) * 2
DIRECTION = RNG.normal(size=(8, 3))
DIRECTION /= np.linalg.norm(DIRECTION, axis=1, keepdims=True)
DEPTH = RNG.uniform(0.1, 8, 8)


def _by_quadrature(camera, direction, source, depth):
    def light(t):
        return 3.0 / np.sum((camera + t * direction - source) ** 2)

    return quad(light, 0, depth, epsabs=1e-12, limit=200)[0]


def test_it_is_the_integral_along_the_line_of_sight():
    with jax.enable_x64(True):
        arrays = (jnp.asarray(a) for a in (CAMERA, DIRECTION, SOURCE, DEPTH))
        found = point_light(3.0, *arrays)
    expected = [
        _by_quadrature(*row)
        for row in zip(CAMERA, DIRECTION, SOURCE, DEPTH, strict=True)
    ]
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_a_line_through_the_source_and_a_distant_one_keep_their_digits():
    origin, ahead = jnp.zeros((1, 3)), jnp.asarray([[1.0, 0.0, 0.0]])
    depth = jnp.asarray([2.0])
    behind = point_light(1.0, origin, ahead, -5 * ahead, depth)
    np.testing.assert_allclose(behind, 1 / 5 - 1 / 7, rtol=1e-5)
    # So far away it is I d/|s|²: depth brightens, for nothing takes light away.
    sun = jnp.asarray([[3e4, 4e4, 0.0]])
    for far in (1.0, 2.0):
        found = point_light(1.0, origin, ahead, sun, far * depth)
        assert found[0] * 2.5e9 == pytest.approx(2 * far, rel=2e-4)


def test_derivatives_are_those_of_differences():
    with jax.enable_x64(True):
        arrays = [jnp.asarray(a) for a in (CAMERA, DIRECTION, SOURCE, DEPTH)]

        def total(x):
            camera, direction, source, depth = arrays
            return point_light(3.0, camera + x[None], direction, source, depth).sum()

        slope = jax.grad(total)(jnp.zeros(3))
        h = 1e-6
        differences = [(total(h * e) - total(-h * e)) / (2 * h) for e in np.eye(3)]
    np.testing.assert_allclose(slope, differences, rtol=1e-6)
