"""The arctangent of our own, beside numpy's, and its derivative."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax.geometry.angles import arctan2


# All octants, their borders, and both axes.
ANGLES = np.concatenate(
    [np.radians(np.arange(-179.9, 180, 0.1)), np.pi / 4 * np.arange(-3, 5)]
)


@pytest.mark.parametrize("size", [1e-12, 1.0, 1e12])
def test_angles_are_those_of_numpy(size):
    y, x = size * np.sin(ANGLES), size * np.cos(ANGLES)
    y, x = y.astype(np.float32), x.astype(np.float32)
    found = jax.jit(arctan2)(jnp.asarray(y), jnp.asarray(x))
    expected = np.arctan2(y.astype(float), x.astype(float))
    assert np.abs(np.asarray(found) - expected).max() < 4e-7


def test_no_direction_has_an_angle_that_is_finite():
    assert float(arctan2(jnp.zeros(()), jnp.zeros(()))) == 0


@pytest.mark.parametrize("mode", [jax.jacfwd, jax.jacrev])
def test_derivatives_have_no_kinks_at_the_borders_of_octants(mode):
    """(x, -y)/(x² + y²), on the axes and where |x| = |y| as anywhere."""
    y, x = jnp.asarray(np.sin(ANGLES), float), jnp.asarray(np.cos(ANGLES), float)
    by_y, by_x = jax.vmap(mode(arctan2, (0, 1)))(y, x)
    np.testing.assert_allclose(by_y, np.cos(ANGLES), atol=1e-6)
    np.testing.assert_allclose(by_x, -np.sin(ANGLES), atol=1e-6)


def test_double_precision_stays_double():
    with jax.enable_x64(True):
        found = arctan2(jnp.asarray(np.sin(ANGLES)), jnp.asarray(np.cos(ANGLES)))
    np.testing.assert_allclose(
        found, np.arctan2(np.sin(ANGLES), np.cos(ANGLES)), atol=1e-15
    )
