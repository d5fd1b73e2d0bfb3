"""Reading one band, from files written in the dialect of the real ones."""

import subprocess
import sys
from datetime import timedelta

import netCDF4
import numpy as np
import pytest
import xarray as xr

from cloudjax_data import (
    DataError,
    EmissiveCalibration,
    ReflectiveCalibration,
    cf_attributes,
)
from cloudjax_data.abi import read_band
from tests.generated import (
    DIALECT,
    SCAN_START,
    default_calibration,
    window,
    write_abi_cmi,
    write_abi_l1b,
)


def ramp(band, shape=(4, 6)):
    dialect = DIALECT[band]
    highest = dialect.scale * (dialect.fill - 2) + dialect.offset
    return np.linspace(dialect.offset * 0.9, highest, shape[0] * shape[1]).reshape(
        shape
    )


@pytest.mark.parametrize("number", range(1, 17))
def test_radiance_is_recovered_within_half_a_count(tmp_path, number):
    radiance = ramp(number)
    band = read_band(write_abi_l1b(tmp_path, band=number, radiance=radiance))
    assert band.number == number
    assert band.good.all()
    np.testing.assert_allclose(
        band.radiance, radiance, atol=0.501 * DIALECT[number].scale
    )
    kind = EmissiveCalibration if number >= 7 else ReflectiveCalibration
    assert isinstance(band.calibration, kind)


def test_identity_comes_from_the_header(tmp_path):
    path = write_abi_l1b(tmp_path, band=13, radiance=ramp(13), name="renamed.nc")
    band = read_band(path)
    assert (band.platform, band.orbital_slot, band.sector) == ("G17", "GOES-West", "M1")
    assert band.start == SCAN_START
    assert band.end == SCAN_START + timedelta(seconds=5.7)
    assert band.time == SCAN_START + timedelta(seconds=2.85)
    assert band.wavelength_um == 10.33
    assert band.units == "mW m-2 sr-1 (cm-1)-1"
    assert band.path == path


def test_scan_angles_are_not_rounded_to_float32(tmp_path):
    grid = window((3, 5424), west_edge_rad=-0.151872)
    radiance = np.full(grid.shape, 50.0)
    band = read_band(write_abi_l1b(tmp_path, band=13, radiance=radiance, grid=grid))
    np.testing.assert_allclose(band.grid.x_rad, grid.x_rad, rtol=0, atol=1e-12)
    np.testing.assert_allclose(band.grid.y_rad, grid.y_rad, rtol=0, atol=1e-12)
    assert cf_attributes(band.grid) == cf_attributes(grid)


def test_scan_angles_of_a_copy_rewritten_by_xarray(tmp_path):
    grid = window((6, 8), 2.8e-5)
    path = write_abi_l1b(tmp_path, band=3, radiance=np.ones(grid.shape), grid=grid)
    with xr.open_dataset(path, decode_times=False) as decoded:
        float32 = {name: decoded[name].astype(np.float32) for name in "xy"}
        decoded.assign_coords(float32).drop_encoding().to_netcdf(tmp_path / "copy.nc")
    with netCDF4.Dataset(tmp_path / "copy.nc", "a") as copy:
        assert copy["x"].dtype == np.float32
    band = read_band(tmp_path / "copy.nc")
    np.testing.assert_allclose(band.grid.x_rad, grid.x_rad, rtol=0, atol=1e-12)


def test_quality_flags_choose_pixels(tmp_path):
    dqf = np.array([[0, 1, 2], [3, 4, 255]])
    radiance = np.full(dqf.shape, 50.0)
    path = write_abi_l1b(tmp_path, band=13, radiance=radiance, dqf=dqf)
    strict = read_band(path)
    np.testing.assert_array_equal(strict.good, dqf == 0)
    np.testing.assert_array_equal(np.isnan(strict.radiance), dqf != 0)
    lenient = read_band(path, keep_conditionally_usable=True)
    np.testing.assert_array_equal(lenient.good, dqf <= 1)


def test_fill_values_are_bad_whatever_the_flag(tmp_path):
    radiance = np.array([[50.0, np.nan]])
    dqf = np.zeros((1, 2), int)
    band = read_band(write_abi_l1b(tmp_path, band=13, radiance=radiance, dqf=dqf))
    np.testing.assert_array_equal(band.good, [[True, False]])


def test_negative_radiances_are_kept(tmp_path):
    band = read_band(write_abi_l1b(tmp_path, band=3, radiance=np.full((2, 2), -0.5)))
    assert band.good.all()
    assert (band.radiance < 0).all()


def test_brightness_temperature_is_clipped_at_the_first_positive_count(tmp_path):
    path = write_abi_l1b(tmp_path, band=7, radiance=np.array([[-0.03, 0.0, 0.5]]))
    band = read_band(path)
    assert isinstance(band.calibration, EmissiveCalibration)
    temperature = band.calibration.brightness_temperature_k(band.radiance)
    np.testing.assert_allclose(temperature[0, :2], 197.5, atol=0.3)
    assert np.isfinite(temperature).all()


@pytest.mark.parametrize("number", [2, 5, 7, 13])
def test_cmi_is_taken_back_to_radiance(tmp_path, number):
    radiance = default_calibration(number).radiance(
        np.linspace(220.0, 300.0, 12).reshape(3, 4)
        if number >= 7
        else np.linspace(0.0, 1.2, 12).reshape(3, 4)
    )
    band = read_band(write_abi_cmi(tmp_path, radiance={number: radiance}))
    np.testing.assert_allclose(band.radiance, radiance, rtol=4e-3, atol=0.05)
    assert band.units == default_calibration(number).units


def test_a_band_of_a_multi_band_file(tmp_path):
    radiance = {2: np.full((2, 3), 300.0), 13: np.full((2, 3), 80.0)}
    path = write_abi_cmi(tmp_path, radiance=radiance, multi_band=True)
    assert read_band(path, band=13).number == 13
    np.testing.assert_allclose(read_band(path, band=2).radiance, 300.0, rtol=1e-3)
    with pytest.raises(DataError, match=r"bands \[2, 13\]: say which"):
        read_band(path)
    with pytest.raises(DataError, match="and not 7"):
        read_band(path, band=7)


@pytest.mark.parametrize(
    ("number", "coefficients"),
    [
        (3, {"kappa0": 0.0033}),
        (13, {"planck_fk2": 1400.0}),
        # the misprint of a public list
        (14, {"planck_fk2": 1286.67}),
    ],
)
def test_contradicting_coefficients_are_refused(tmp_path, number, coefficients):
    path = write_abi_l1b(
        tmp_path, band=number, radiance=ramp(number), coefficients=coefficients
    )
    with pytest.raises(DataError, match="contradicts itself"):
        read_band(path)


@pytest.mark.parametrize("part", [0.0, 0.02, 0.3, 0.9, 0.999])
def test_truncated_files_are_named(tmp_path, part):
    path = write_abi_l1b(tmp_path, band=13, radiance=ramp(13, (60, 60)))
    whole = path.read_bytes()
    path.write_bytes(whole[: int(part * len(whole))])
    with pytest.raises(DataError, match=rf"{path.name}.*download it again"):
        read_band(path)


def test_corruption_found_only_on_reading_is_named(tmp_path):
    radiance = np.random.default_rng(0).uniform(20.0, 120.0, (200, 200))
    path = write_abi_l1b(tmp_path, band=13, radiance=radiance)
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 400] = bytes(400)
    path.write_bytes(data)
    with pytest.raises(DataError, match=rf"{path.name}.*download it again"):
        read_band(path)


def test_files_of_another_kind_are_named(tmp_path):
    with pytest.raises(DataError, match=r"absent\.nc is not a file"):
        read_band(tmp_path / "absent.nc")
    with pytest.raises(DataError, match="is not a file"):
        read_band(tmp_path)
    (tmp_path / "text.nc").write_text("not a netCDF file")
    with pytest.raises(DataError, match=r"text\.nc cannot be read"):
        read_band(tmp_path / "text.nc")
    netCDF4.Dataset(tmp_path / "empty.nc", "w").close()
    with pytest.raises(DataError, match=r"empty\.nc has no value for 'band_id'"):
        read_band(tmp_path / "empty.nc")


@pytest.mark.parametrize("name", ["platform_ID", "time_coverage_start"])
def test_missing_attributes_are_named(tmp_path, name):
    path = write_abi_l1b(tmp_path, band=13, radiance=ramp(13))
    with netCDF4.Dataset(path, "a") as file:
        file.delncattr(name)
    with pytest.raises(DataError, match=f"lacks the global attribute '{name}'"):
        read_band(path)


def test_a_time_that_is_none_is_named(tmp_path):
    path = write_abi_l1b(tmp_path, band=13, radiance=ramp(13))
    with netCDF4.Dataset(path, "a") as file:
        file.time_coverage_end = "yesterday"
    with pytest.raises(DataError, match="time_coverage_end 'yesterday'"):
        read_band(path)


@pytest.mark.parametrize("module", ["cloudjax_data", "cloudjax_data.abi"])
def test_importing_pulls_in_neither_jax_nor_slow_libraries(module):
    unwanted = ["jax", "eccodes", "pvlib", "scipy", "pyproj"]
    code = f"import sys, {module}; print([m for m in {unwanted} if m in sys.modules])"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"
