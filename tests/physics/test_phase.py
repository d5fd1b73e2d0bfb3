"""Phase functions against their definitions."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import CornetteShanks, DoubleHenyeyGreenstein, HenyeyGreenstein


PHASES = (
    HenyeyGreenstein(jnp.asarray(0.85)),
    HenyeyGreenstein(jnp.asarray(0.0)),
    DoubleHenyeyGreenstein(*map(jnp.asarray, (0.85, -0.5, 0.9))),
    CornetteShanks(jnp.asarray(0.8)),
    CornetteShanks(jnp.asarray(0.0)),
)


@pytest.mark.parametrize("phase", PHASES)
def test_moments_are_means_of_legendre_polynomials(phase):
    """Geometry: the sphere. Expectation: mean 1; means of P_1 to P_4 are the moments.

    Source: definition, by Gauss quadrature. Tolerance: 1e-5, float32.
    """
    cosine, weight = np.polynomial.legendre.leggauss(200)
    value = weight / 2 * np.asarray(phase(jnp.asarray(cosine, float)))
    assert value.sum() == pytest.approx(1, abs=1e-5)
    polynomials = np.polynomial.legendre.legvander(cosine, 4)[:, 1:]
    np.testing.assert_allclose(phase.moments, value @ polynomials, atol=1e-5)
    assert float(phase.asymmetry) == float(phase.moments[0])


def test_cornette_and_shanks_is_rayleigh_s_without_asymmetry():
    """Expectation: 3/4 (1 + cos²Θ). Source: Rayleigh. Tolerance: rounding."""
    cosine = jnp.linspace(-1, 1, 9)
    expected = 0.75 * (1 + cosine**2)
    np.testing.assert_allclose(PHASES[-1](cosine), expected, rtol=1e-6)


@pytest.mark.parametrize("phase", PHASES)
def test_derivatives_are_finite_to_both_ends(phase):
    """Forwards and backwards, by the cosine and by the parameters."""
    for cosine in (-1.0, 0.0, 1.0):
        slopes = jax.grad(lambda p, c: p(c))(phase, cosine)
        assert np.isfinite(jax.tree.leaves(slopes)).all()
        assert np.isfinite(jax.grad(lambda c: phase(c))(cosine))
