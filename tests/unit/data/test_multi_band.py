"""Imagery of many bands has no coefficients: what it holds comes back as it is."""

import netCDF4
import numpy as np
import pytest

from cloudjax.light.bands import nominal_bands
from cloudjax_data import (
    DataError,
    EmissiveCalibration,
    ReflectiveCalibration,
    read_band,
)
from tests.generated import default_calibration, write_abi_cmi
from tests.mutations.netcdf_content import changed


SHAPE = (4, 6)
COEFFICIENTS = ("planck", "kappa0", "esun", "earth_sun")


def _write(folder, sector="F", platform="G16", numbers=tuple(range(1, 17))):
    rng = np.random.default_rng(1)
    radiance = {
        n: default_calibration(n).radiance(
            rng.uniform(0.02, 1.1, SHAPE) if n < 7 else rng.uniform(200, 310, SHAPE)
        )
        for n in numbers
    }
    return write_abi_cmi(
        folder, radiance=radiance, multi_band=True, platform=platform, sector=sector
    )


@pytest.mark.parametrize(
    ("sector", "platform"),
    [("F", "G16"), ("C", "G19"), ("M1", "G17"), ("M2", "G18")],
)
def test_temperatures_and_reflectances_come_back(tmp_path, sector, platform):
    """By the automatic decoding of netCDF4, to the rounding of float32."""
    path = _write(tmp_path, sector, platform, (1, 2, 6, 7, 10, 13, 16))
    with netCDF4.Dataset(path) as file:
        assert not [n for n in file.variables if n.startswith(COEFFICIENTS)]
        shown = {
            n: np.asarray(file[f"CMI_C{n:02d}"][...]) for n in (1, 2, 6, 7, 10, 13, 16)
        }
    for number, expected in shown.items():
        band = read_band(path, band=number)
        assert (band.platform, band.sector) == (platform, sector)
        assert band.good.all()
        calibration = band.calibration
        if isinstance(calibration, ReflectiveCalibration):
            found = calibration.reflectance(band.radiance)
            np.testing.assert_allclose(found, expected, rtol=1e-6)
        else:
            found = calibration.brightness_temperature_k(band.radiance)
            np.testing.assert_allclose(found, expected, atol=2e-3)
        assert "no calibration coefficients: the nominal ones" in band.notes[0]


def test_the_coefficients_are_those_of_the_platform(tmp_path):
    """GOES-17: of its L1b files; GOES-16: of the renderer; others: of GOES-16."""
    of = {}
    for platform in ("G16", "G17", "G19"):
        band = read_band(_write(tmp_path, platform=platform), band=13)
        assert isinstance(band.calibration, EmissiveCalibration)
        of[platform] = band.calibration.fk1, band.calibration.fk2
        (said,) = band.notes
        assert said.endswith(
            "of GOES-17 serve." if platform == "G17" else "of GOES-16 serve."
        )
    planck = nominal_bands()[13].planck
    assert planck is not None
    assert of["G16"] == of["G19"] == planck[:2]
    assert of["G17"] == (10835.6, 1394.12)


def test_the_sun_is_as_far_as_on_the_date(tmp_path):
    """27 October: 0.9938448 by the L1b files of that day; 1.0 would be 1.2 % off."""
    band = read_band(_write(tmp_path), band=1)
    assert isinstance(band.calibration, ReflectiveCalibration)
    expected = np.pi * 0.9938448**2 / 2017.1648
    found = band.calibration.reflectance_per_radiance
    assert found == pytest.approx(expected, rel=1e-4)


def test_files_of_single_bands_have_their_own(tmp_path):
    path = write_abi_cmi(tmp_path, radiance={13: np.full(SHAPE, 60.0)})
    band = read_band(path)
    assert not band.notes


def test_some_of_the_coefficients_are_not_enough(tmp_path):
    def lose_one(content):
        del content.variables["planck_bc1"]

    path = write_abi_cmi(tmp_path, radiance={13: np.full(SHAPE, 60.0)})
    with pytest.raises(DataError, match="no value for 'planck_bc1'"):
        read_band(changed(path, lose_one))


def test_a_band_that_is_called_another_is_refused(tmp_path):
    def exchange(content):
        content.variables["band_id_C13"].stored = np.array([14], "i1")

    path = changed(_write(tmp_path), exchange)
    with pytest.raises(DataError, match="calls 'CMI_C13' band 14"):
        read_band(path, band=13)
