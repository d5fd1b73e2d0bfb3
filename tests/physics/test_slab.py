"""The two-flux slab against independent solutions of its equations."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import expm

from cloudjax.light.reflection import slab


DEPTHS = np.array([1e-6, 0.01, 0.3, 1.0, 3.0, 10.0])


def _solved(depth: float, albedo: float) -> tuple[float, float]:
    """Reflectance and transmittance from the matrix exponential of eqs (2a, 2b).

    dI_f/dx = -I_f + ω I_r and -dI_r/dx = -I_r + ω I_f, I_f(0) = 1, I_r(τ) = 0.
    """
    through = expm(depth * np.array([[-1, albedo], [-albedo, 1]]))
    reflected = -through[1, 0] / through[1, 1]
    return reflected, through[0, 0] + through[0, 1] * reflected


def test_the_slab_solves_the_equations_of_the_paper():
    """Geometry: a slab lit straight from above, two opposite streams.

    Expectation: the solution of eqs (2a, 2b) of Schinder et al. (2024), (2b) with its
    sign put right, by a matrix exponential. Tolerance: 2e-9, the series near K τ = 0.
    """
    for albedo in (0.0, 0.2, 0.9, 0.99, 0.9999, 1.0):
        with jax.enable_x64(True):
            reflected, transmitted = slab(jnp.asarray(DEPTHS), jnp.asarray(1 - albedo))
        expected = np.array([_solved(depth, albedo) for depth in DEPTHS])
        np.testing.assert_allclose(reflected, expected[:, 0], rtol=2e-9, atol=1e-14)
        np.testing.assert_allclose(transmitted, expected[:, 1], rtol=2e-9)


def test_without_absorption_it_is_equation_3():
    """Geometry: as above, ω = 1. Expectation: R = τ/(1 + τ), T = 1/(1 + τ).

    Source: Schinder et al. (2024), eq. (3). Tolerance: rounding.
    """
    with jax.enable_x64(True):
        depth = jnp.asarray([*DEPTHS, 1e3, 1e8])
        reflected, transmitted = slab(depth, jnp.asarray(0.0))
        depth = np.asarray(depth)
    np.testing.assert_allclose(reflected, depth / (1 + depth), rtol=1e-14)
    np.testing.assert_allclose(transmitted, 1 / (1 + depth), rtol=1e-14)


def test_energy_is_kept_without_absorption_and_lost_with_it():
    """Geometry: slabs of all depths. Expectation: R + T = 1 at ω = 1, less otherwise.

    Source: conservation of energy. Tolerance: float32 rounding.
    """
    depth = jnp.logspace(-4, 6, 60)
    np.testing.assert_allclose(sum(slab(depth, jnp.asarray(0.0))), 1, atol=2e-7)
    for co_albedo in (1e-3, 0.1, 1.0):
        kept = sum(slab(depth, jnp.asarray(co_albedo)))
        assert jnp.all(kept < 1)
        assert jnp.all(jnp.diff(kept) < 1e-6)


@pytest.mark.parametrize("albedo", [0.3, 0.5, 0.9, 0.99])
def test_an_endless_slab_has_the_reflectance_of_a_half_space(albedo):
    """Geometry: τ = 1e6. Expectation: R = (1 - √(1 - ω²))/ω, T = 0.

    Source: eqs (2a, 2b) for a half-space; the paper's (4a) leaves out the 1/ω.
    Tolerance: float64 rounding.
    """
    with jax.enable_x64(True):
        reflected, transmitted = slab(jnp.asarray(1e6), jnp.asarray(1 - albedo))
    expected = (1 - np.sqrt(1 - albedo**2)) / albedo
    assert float(reflected) == pytest.approx(expected, rel=1e-12)
    assert float(transmitted) < 1e-30


def test_a_black_slab_only_lets_the_beam_through():
    """Geometry: ω = 0. Expectation: R = 0, T = exp(-τ). Tolerance: 2e-9."""
    with jax.enable_x64(True):
        reflected, transmitted = slab(jnp.asarray(DEPTHS), jnp.asarray(1.0))
    np.testing.assert_array_equal(reflected, 0)
    np.testing.assert_allclose(transmitted, np.exp(-DEPTHS), rtol=2e-9)


def test_slabs_add():
    """Geometry: one slab on another. Expectation: T = T₁T₂/(1 - R₁R₂) and so on.

    Source: the adding method. The equations have two directions only, so that nothing
    is said about reciprocity in angle, which this strategy does not have: it takes the
    line of sight for the depth and the first surface for the sun.
    Tolerance: 1e-9.
    """
    with jax.enable_x64(True):
        co_albedo = jnp.asarray(0.05)
        (r1, t1), (r2, t2), (r, t) = (
            np.asarray(slab(jnp.asarray(depth), co_albedo)) for depth in (0.7, 1.9, 2.6)
        )
    assert t1 * t2 / (1 - r1 * r2) == pytest.approx(t, rel=1e-9)
    assert r1 + t1**2 * r2 / (1 - r1 * r2) == pytest.approx(r, rel=1e-9)
