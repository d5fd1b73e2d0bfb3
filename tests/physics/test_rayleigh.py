"""Rayleigh scattering against published depths and against DISORT."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax.air.clear_air import rayleigh
from cloudjax.air.gases import scattering_depth
from tests.helpers import numbers


# Bodhaine et al. (1999, eq. 30): micrometres, optical depth at 1013.25 hPa.
PUBLISHED = (
    (0.40, 0.360213), (0.47, 0.184836), (0.50, 0.143353), (0.55, 0.097065),
    (0.64, 0.052378), (0.70, 0.036421), (0.865, 0.015490), (1.00, 0.008641),
    (1.378, 0.002393), (1.61, 0.001290), (2.25, 0.000352),
)  # fmt: skip


def test_depths_are_those_of_bodhaine():
    """Geometry: straight up from sea level. Expectation: the printed optical depths.

    Source: Bodhaine et al. (1999, eq. 30) in float64. Tolerance: a unit of the last of
    six digits. Above 700 hPa there is 700/1013.25 of it.
    """
    with jax.enable_x64(True):
        λ, expected = np.array(PUBLISHED).T
        np.testing.assert_allclose(rayleigh.optical_depth(λ), expected, atol=1e-6)
        above = rayleigh.optical_depth(λ, np.full_like(λ, 700.0))
        np.testing.assert_allclose(above, expected * 700 / 1013.25, atol=1e-6)


def test_the_bands_have_the_depths_of_their_middles():
    """Geometry: as above. Expectation: the table's means over the bands' responses are
    near the depths at their central wavelengths. Tolerance: 2 %, for λ⁻⁴ is bent.
    """
    bands = {1: 0.47, 2: 0.64, 3: 0.865, 5: 1.61, 6: 2.25}
    middle = rayleigh.optical_depth(np.array(list(bands.values())))
    np.testing.assert_allclose(scattering_depth(list(bands)), middle, rtol=0.03)


def test_the_phase_function_has_a_mean_of_one():
    """Geometry: all directions. Expectation: ∫ P dΩ = 4π. Tolerance: rounding."""
    x, weight = np.polynomial.legendre.leggauss(8)
    assert rayleigh.phase_function(jnp.asarray(x, float)) @ weight == pytest.approx(2)


# numpy from 2.5 on gives the oracle complex eigenvalues; what it makes of them is held
# against ours here.
@pytest.mark.filterwarnings("default:Some eigenvalues of the coefficient:UserWarning")
@pytest.mark.parametrize("depth", [0.0155, 0.0524, 0.185])
def test_reflectance_and_transmittance_are_those_of_disort(depth):
    """Geometry: air of the depths of bands 3, 2 and 1 over nothing, cosines from 0.1.

    Expectation: πL/(μ₀F₀) and the flux that comes through, of 32 streams. Source:
    PythonicDISORT, run here. Tolerance: 3.5 % of the reflectance, where light scattered
    once would fall short by up to 30 %; 0.7 % of the transmittance for cosines from
    0.2.
    """
    oracle = pytest.importorskip("PythonicDISORT")
    moments = np.zeros(32)
    γ = 0.0279 / (2 - 0.0279)
    moments[[0, 2]] = 1, (1 - γ) / (1 + 2 * γ) / 10
    for sun in (0.1, 0.4, 1.0):
        cosines, _, down, _, seen = oracle.pydisort(
            np.array([depth]), np.array([1 - 1e-6]), 32, moments[None], sun, 1.0, 0.0
        )
        views = np.array(cosines[:16])
        views = views[views >= 0.1]
        τ, μ0 = numbers(*[depth] * len(views)), numbers(*[sun] * len(views))
        for azimuth in (0.0, 1.5, 3.0):
            expected = np.pi * seen(0.0, azimuth)[: len(cosines) // 2] / sun
            expected = expected[np.array(cosines[:16]) >= 0.1]
            sines = np.sqrt((1 - sun**2) * (1 - views**2))
            scattering = numbers(*(sines * np.cos(azimuth) - sun * views))
            found = rayleigh.reflectance(τ, μ0, numbers(*views), scattering)
            np.testing.assert_allclose(found, expected, rtol=0.035)
        if sun >= 0.2:
            through = sum(map(float, down(depth))) / sun
            passed = rayleigh.transmittance(τ, μ0)[0]
            assert float(passed) == pytest.approx(through, rel=0.007)


def test_air_loses_no_light():
    """Geometry: light from everywhere. Expectation: 1 - 2 ∫ T μ dμ is sent back.

    Source: conservation of energy; the integral with 64 points. Tolerance: 2e-4.
    """
    x, weight = np.polynomial.legendre.leggauss(64)
    for depth in (0.01, 0.2):
        τ, μ = numbers(*[depth] * 64), numbers(*(x + 1) / 2)
        passed = float((rayleigh.transmittance(τ, μ) * μ) @ weight)
        assert float(rayleigh.spherical_albedo(τ)[0]) == pytest.approx(
            1 - passed, abs=2e-4
        )


def test_sun_and_viewer_may_swap():
    """Geometry: two slants. Expectation: the same reflectance. Source: reciprocity."""
    τ, a, b, cosine = numbers(0.2), numbers(0.3), numbers(0.9), numbers(-0.4)
    there, back = (rayleigh.reflectance(τ, *pair, cosine) for pair in ((a, b), (b, a)))
    assert float(there[0]) == pytest.approx(float(back[0]), rel=1e-6)
