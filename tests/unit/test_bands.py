"""Radiances of the bands against the published coefficients of ABI."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import Band, EmissiveBands, ReflectiveBands, bands_named, nominal_bands
from cloudjax_data import EmissiveCalibration
from tests.helpers import (
    BLACK_BODIES,
    PLANCK,
    SOLAR,
    emissive_bands,
    numbers,
    reflective_bands,
)


def test_the_planck_functions_of_all_emissive_bands():
    """Black bodies at 300 and 220 K, as tabulated to seven digits. float32: 2e-5."""
    bands = emissive_bands(*PLANCK)
    found = bands.planck(numbers(300, 220))
    expected = [BLACK_BODIES[band] for band in PLANCK]
    np.testing.assert_allclose(found, expected, rtol=5e-5)


def test_the_table_itself_follows_plancks_law():
    """fk1 = c₁ν³ and fk2 = c₂ν: one wavenumber explains both."""
    for fk1, fk2, _, _ in PLANCK.values():
        wavenumber = (fk1 / 1.191042972e-5) ** (1 / 3)
        assert fk2 == pytest.approx(1.438776877 * wavenumber, rel=1e-5)


def test_brightness_temperatures_come_back():
    bands = emissive_bands(*PLANCK)
    kelvin = jnp.linspace(180, 340, 33)
    back = bands.brightness_temperature_k(bands.planck(kelvin))
    np.testing.assert_allclose(back, np.tile(kelvin, (10, 1)), rtol=2e-6)


def test_radiances_that_are_not_positive_have_no_temperature():
    bands = emissive_bands(13)
    dark = jnp.asarray([[0.0, -1.0, 1e-30]])
    found = bands.brightness_temperature_k(dark)
    assert found[0, :2].tolist() == [0, 0]
    slope = jax.grad(lambda x: bands.brightness_temperature_k(x).sum())(dark[:, :2])
    np.testing.assert_array_equal(slope, 0)


@pytest.mark.parametrize("kelvin", [0.0, -5.0, 1e-3, 1.0, 10.0, 1e4])
def test_radiances_of_impossible_temperatures_are_finite(kelvin):
    bands = emissive_bands(*PLANCK)
    t = numbers(kelvin)
    value, slope = jax.jvp(bands.planck, (t,), (jnp.ones_like(t),))
    assert jnp.isfinite(value).all()
    assert jnp.isfinite(slope).all()
    assert jnp.all(value >= 0)
    if kelvin <= 10:
        assert jnp.all(value < 1e-20)


def test_files_and_pictures_share_the_planck_function():
    """From 1 K, where both are finite, to where float32 rounds by some 1e-5."""
    kelvin = np.array([-5.0, 1.0, 20.0, 50.0, 100.0, 400.0])
    found = emissive_bands(*PLANCK).planck(jnp.asarray(kelvin, float))
    for row, coefficients in zip(found, PLANCK.values(), strict=True):
        expected = EmissiveCalibration(*coefficients).radiance(kelvin)
        np.testing.assert_allclose(row, expected, rtol=5e-5)
        assert expected[0] == expected[1] > 0


def test_warmer_is_brighter_in_every_band():
    radiance = np.asarray(emissive_bands(*PLANCK).planck(jnp.linspace(150, 350, 50)))
    assert np.all(np.diff(radiance, axis=-1) > 0)


def test_a_white_lambertian_surface_reflects_the_sun_over_pi():
    bands = reflective_bands(*SOLAR)
    white = bands.radiance(jnp.ones((len(SOLAR), 1)))
    expected = np.array(list(SOLAR.values())) / np.pi
    np.testing.assert_allclose(white[:, 0], expected, rtol=1e-6)
    np.testing.assert_allclose(bands.reflectance(white), 1, rtol=1e-6)


def test_bands_are_found_by_number_and_name():
    known = nominal_bands()
    assert bands_named(2, "C02", "2") == [known[2]] * 3
    with pytest.raises(ValueError, match="no band 17"):
        bands_named(1, 17)
    with pytest.raises(ValueError, match="neither reflects nor emits"):
        Band(3, 0.87)
    assert len({known[2], known[13], *bands_named("C13")}) == 2


def test_parts_of_bands_take_what_belongs_to_them():
    """Band 7 is in both; κ₀ grows with the square of the distance."""
    bands = bands_named(2, 7, 13)
    reflective = ReflectiveBands.of(bands, 1.1, path=[0.1, 0.0])
    emissive = EmissiveBands.of(bands)
    assert reflective is not None
    assert emissive is not None
    assert (reflective.numbers, emissive.numbers) == ((2, 7), (7, 13))
    expected = [b.coefficients(1.1)["kappa0"] for b in bands[:2]]
    assert expected[0] == pytest.approx(1.21 * np.pi / 1631.3351)
    np.testing.assert_allclose(reflective.reflectance_per_radiance, expected, 1e-6)
    np.testing.assert_allclose(reflective.path, [0.1, 0.0])
    assert float(emissive.bc2[1]) == pytest.approx(bands[2].coefficients()["bc2"])
    assert ReflectiveBands.of(bands[2:]) is None
    assert EmissiveBands.of(bands[:1]) is None
