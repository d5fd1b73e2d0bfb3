"""Radiance to reflectance and brightness temperature."""

import numpy as np
import pytest

from cloudjax_data import EmissiveCalibration, ReflectiveCalibration
from tests.generated import default_calibration
from tests.helpers import BLACK_BODIES


@pytest.mark.parametrize("band", BLACK_BODIES)
def test_brightness_temperature(band):
    calibration = default_calibration(band)
    assert isinstance(calibration, EmissiveCalibration)
    temperature = np.array([300.0, 220.0])
    np.testing.assert_allclose(
        calibration.radiance(temperature), BLACK_BODIES[band], rtol=3e-5
    )
    np.testing.assert_allclose(
        calibration.brightness_temperature_k(calibration.radiance(temperature)),
        temperature,
        rtol=1e-12,
    )


def test_brightness_temperature_is_nan_only_where_radiance_is():
    calibration = EmissiveCalibration(10803.3, 1392.74, 0.0755, 0.99975)
    radiance = np.array([-2.0, 0.0, 50.0, np.nan], np.float32)
    temperature = calibration.brightness_temperature_k(radiance)
    np.testing.assert_array_equal(np.isnan(temperature), np.isnan(radiance))
    assert temperature.dtype == np.float32


def test_reflectance_keeps_noise_and_inverts():
    calibration = default_calibration(3)
    assert isinstance(calibration, ReflectiveCalibration)
    radiance = np.array([-0.5, 0.0, 200.0])
    reflectance = calibration.reflectance(radiance)
    assert reflectance[0] < 0
    # pi d^2 L / esun
    np.testing.assert_allclose(
        reflectance[2], np.pi * 0.9938448**2 * 200.0 / 957.0699, rtol=1e-12
    )
    np.testing.assert_allclose(calibration.radiance(reflectance), radiance)


@pytest.mark.parametrize("band", range(1, 17))
def test_published_coefficients_agree(band):
    assert default_calibration(band).inconsistency() is None
