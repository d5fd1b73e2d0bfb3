"""The clear atmosphere against the printed US Standard Atmosphere 1976."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax.air.atmosphere import (
    AbstractTemperature,
    StandardAtmosphere,
    TemperatureProfile,
    pressure_pa,
    temperature_k,
)


# geometric altitude m, temperature K, pressure Pa, density kg/m³, as printed
TABLE = [
    (0, "288.150", "101325", "1.22500"),
    (500, "284.900", "95461.3", "1.16727"),
    (1000, "281.651", "89876.3", "1.11166"),
    (2000, "275.154", "79501.4", "1.00655"),
    (4000, "262.166", "61660.4", ".81935"),
    (5000, "255.676", "54048.3", ".73643"),
    (6000, "249.187", "47217.6", ".66011"),
    (8000, "236.215", "35651.6", ".52579"),
    (10000, "223.252", "26499.9", ".41351"),
    (11000, "216.774", "22700.0", ".36480"),
    (12000, "216.650", "19399.5", ".31194"),
    (15000, "216.650", "12111.8", ".19476"),
    (20000, "216.650", "5529.31", ".08891"),
    (30000, "226.509", "1197.03", ".01841"),
]
# J/(kg K), of the standard's own gas constant and molar mass.
DRY_AIR = 8314.32 / 28.9644
LAYER_TOPS_KM = [11, 20, 32, 47, 51, 71]


@pytest.mark.parametrize("row", TABLE, ids=lambda row: f"{row[0]} m")
def test_the_standard_atmosphere_agrees_with_its_table_to_the_printed_digits(row):
    """Geometry: one altitude. Expectation: T, p and ρ as printed.

    Source: US Standard Atmosphere 1976, as tabulated at av8n.com/physics/altimetry.htm.
    Tolerance: 0.52 units of the last digit, since 19399.448 Pa at 12 km was printed as
    19399.5 from a base pressure that had been rounded; 2e-6 more in float32.
    """
    altitude, *printed = row
    for x64 in (True, False):
        with jax.enable_x64(x64):
            kelvin, pascal = (f(float(altitude)) for f in (temperature_k, pressure_pa))
            found = kelvin, pascal, pascal / (DRY_AIR * kelvin)
            for value, digits in zip(found, printed, strict=True):
                half = 0.52 * 10.0 ** -len(digits.partition(".")[2])
                slack = 0 if x64 else 2e-6 * float(digits)
                assert abs(float(value) - float(digits)) <= half + slack


def test_pressure_is_hydrostatic():
    """Geometry: a column to 80 km. Expectation: dp/dz = -ρ g(z), g = g₀(r₀/(r₀+z))².

    Source: hydrostatic balance. Tolerance: 1e-10 relative, float64 derivatives.
    """
    with jax.enable_x64(True):
        z = jnp.linspace(-4000.0, 80e3, 337)
        slope = jax.vmap(jax.grad(pressure_pa))(z)
        gravity = 9.80665 * (6_356_766 / (6_356_766 + z)) ** 2
        density = pressure_pa(z) / (DRY_AIR * temperature_k(z))
        np.testing.assert_allclose(slope, -density * gravity, rtol=1e-10)


def test_layers_join_without_a_step():
    """Geometry: 1 mm either side of each layer boundary. Expectation: equal values.

    Source: continuity. Tolerance: what the gradients allow over 2 mm.
    """
    with jax.enable_x64(True):
        geopotential = 1e3 * jnp.asarray(LAYER_TOPS_KM, float)
        z = 6_356_766 * geopotential / (6_356_766 - geopotential)
        for f in (temperature_k, pressure_pa):
            np.testing.assert_allclose(f(z - 1e-3), f(z + 1e-3), rtol=1e-6)


@pytest.mark.parametrize("f", [temperature_k, pressure_pa])
def test_values_and_gradients_are_finite_at_any_altitude(f):
    """Geometry: from the centre of the Earth to infinity. Expectation: finite, > 0."""
    z = jnp.asarray([-jnp.inf, -6_356_766.0, -1e4, 0.0, 11e3, 9e4, 1e12, jnp.inf])
    assert jnp.all(jnp.isfinite(f(z)))
    assert jnp.all(f(z) > 0)
    assert jnp.all(jnp.isfinite(jax.vmap(jax.grad(f))(z)))


@pytest.mark.parametrize("x64", [False, True])
def test_the_dtype_of_the_altitude_is_kept(x64):
    with jax.enable_x64(x64):
        assert temperature_k(jnp.zeros(3, jnp.float32)).dtype == jnp.float32
        assert pressure_pa(jnp.zeros((2, 2), jnp.float32)).dtype == jnp.float32


def test_a_profile_interpolates_holds_its_ends_and_shifts():
    levels = jnp.asarray([0.0, 1000.0, 3000.0])
    profile = TemperatureProfile(
        levels, jnp.asarray([290.0, 280.0, 270.0]), offset_k=2.0
    )
    found = profile(jnp.asarray([-50.0, 500.0, 2000.0, 9000.0]))
    np.testing.assert_allclose(found, [292.0, 287.0, 277.0, 272.0], rtol=1e-6)
    assert isinstance(profile, AbstractTemperature)


def test_a_profile_of_the_standard_is_the_standard():
    """Geometry: 13 levels within the linear troposphere, 33 points between.

    Expectation: `TemperatureProfile` equals `StandardAtmosphere`. Source: linearity in
    geopotential. Tolerance: 0.01 K, the curvature of the geopotential over 1 km.
    """
    z = jnp.linspace(0.0, 10e3, 13)
    profile = TemperatureProfile(z, temperature_k(z))
    between = jnp.linspace(0.0, 10e3, 33)
    np.testing.assert_allclose(
        profile(between), StandardAtmosphere()(between), atol=0.01
    )
    np.testing.assert_allclose(StandardAtmosphere(offset_k=-5.0)(0.0), 283.15)


def test_gradients_of_a_profile_are_finite_everywhere():
    profile = TemperatureProfile(jnp.asarray([0.0, 1e3]), jnp.asarray([290.0, 280.0]))
    z = jnp.asarray([-1.0, 0.0, 500.0, 1e3, 2e3])
    assert jnp.all(jnp.isfinite(jax.vmap(jax.grad(profile))(z)))
    by_profile = jax.grad(lambda p: p(z).sum(), allow_int=True)(profile)
    assert all(jnp.all(jnp.isfinite(leaf)) for leaf in jax.tree.leaves(by_profile))


@pytest.mark.parametrize(
    ("levels", "message"),
    [([1e3, 0.0], "ascend"), ([0.0], "two levels"), ([0.0, jnp.nan], "NaN")],
)
def test_a_profile_refuses_levels_it_cannot_interpolate(levels, message):
    with pytest.raises(ValueError, match=message):
        TemperatureProfile(jnp.asarray(levels), jnp.full(len(levels), 280.0))


def test_both_precisions_serve_in_one_process():
    """In this order, and from numpy's arrays, jax refused the second call."""
    levels = np.linspace(0.0, 60e3, 24)
    single = temperature_k(levels)
    with jax.enable_x64(True):
        double = np.asarray(temperature_k(levels))
    np.testing.assert_allclose(single, double, rtol=1e-6)
