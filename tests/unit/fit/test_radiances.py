from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from tests.generated import SCAN_START
from tests.scenes import write_scene

import cloudjax_data
from cloudjax_data import DataError
from cloudjax_fit.band_radiances import BandRadiances
from cloudjax_fit.comparison import compare
from cloudjax_fit.radiance_files import read_radiances


VISIBLE = "W m-2 sr-1 um-1"
THERMAL = "mW m-2 sr-1 (cm-1)-1"


def _simulated(path: Path, encoding=None, **attributes) -> np.ndarray:
    image = np.arange(6, dtype=np.float32).reshape(2, 3)
    image[0, 0] = np.nan
    attributes = {"units": THERMAL, "abi_band": 13} | attributes
    kept = {key: value for key, value in attributes.items() if value is not None}
    variables = {
        "radiance_C13": (("y", "x"), image, kept),
        "cloud": (("y", "x"), image),
    }
    xr.Dataset(variables).to_netcdf(path, encoding=encoding)
    return image


def test_simulated_files_are_read(tmp_path):
    image = _simulated(tmp_path / "simulated.nc")
    bands = read_radiances(tmp_path / "simulated.nc")
    assert list(bands) == [13]
    assert bands[13].units == THERMAL
    np.testing.assert_array_equal(bands[13].values, image)
    np.testing.assert_array_equal(bands[13].pixels(), image.ravel()[1:])


def test_packed_simulated_files_are_unpacked(tmp_path):
    packing = {"dtype": "int16", "scale_factor": 0.5, "_FillValue": -1}
    image = _simulated(tmp_path / "s.nc", {"radiance_C13": packing})
    np.testing.assert_array_equal(read_radiances(tmp_path / "s.nc")[13].values, image)


def test_folders_and_their_files_hold_what_their_reader_finds(tmp_path):
    folder = write_scene(tmp_path / "scene", bands=(1, 13))
    found = read_radiances(str(folder))
    assert list(found) == [1, 13]
    for file in folder.glob("*.nc"):
        band = cloudjax_data.read_band(file)
        (alone,) = read_radiances(file).values()
        for read in (found[band.number], alone):
            assert (read.number, read.units) == (band.number, band.units)
            assert (read.time, read.grid) == (band.time, band.grid)
            shown = band.calibration.radiance(read.shown())
            np.testing.assert_allclose(shown, band.radiance, rtol=1e-4)
            np.testing.assert_array_equal(read.values, band.radiance)


@pytest.mark.parametrize(
    ("variables", "expected"),
    [(["Rad"], [7]), (["CMI"], [7]), (["CMI_C02", "CMI_C13", "DQF_C02"], [2, 13])],
)
def test_single_abi_files_are_read_by_the_data_package(
    tmp_path, monkeypatch, variables, expected
):
    def read_band(path, band=7):
        return SimpleNamespace(
            number=band,
            units=THERMAL,
            radiance=np.ones((2, 2)),
            grid=None,
            time=SCAN_START,
        )

    monkeypatch.setattr(cloudjax_data, "read_band", read_band)
    monkeypatch.setattr("cloudjax_scenes.abi_bands.band_of_file", lambda band: None)
    xr.Dataset({name: ("y", [0.0]) for name in variables}).to_netcdf(tmp_path / "a.nc")
    assert list(read_radiances(tmp_path / "a.nc")) == expected


@pytest.mark.shared_data
def test_a_real_file_is_the_band_of_its_folder(shared_data):
    folder = shared_data / "goes17_m1_20191027T2000"
    (file,) = folder.glob("*C13_*.nc")
    alone, among = read_radiances(file), read_radiances(folder)
    assert len(among) > 10
    np.testing.assert_array_equal(alone[13].values, among[13].values)
    comparison = compare(alone, among, ("file", "folder"))
    assert [band.number for band in comparison.bands] == [13]
    assert comparison.bands[0].distances.w1 == 0
    assert len(comparison.warnings) == 1


def _text(path: Path):
    path.write_text("not a netCDF file")


def _truncated(path: Path):
    _simulated(path)
    path.write_bytes(path.read_bytes()[:-3000])


def _foreign(path: Path):
    xr.Dataset({"temperature": ("x", [1.0])}).to_netcdf(path)


def _no_units(path: Path):
    _simulated(path, units=None)


def _other_band(path: Path):
    _simulated(path, abi_band=14)


def _cube(path: Path):
    values = np.zeros((2, 2, 2))
    variable = (("time", "y", "x"), values, {"units": THERMAL})
    xr.Dataset({"radiance_C13": variable}).to_netcdf(path)


@pytest.mark.parametrize(
    ("write", "message"),
    [
        (lambda path: None, r"does not exist: give"),
        (_text, r"cannot be read as netCDF: .* again"),
        (_truncated, r"cannot be read as netCDF: .* again"),
        (_foreign, r"holds neither ABI radiances .*: give"),
        (_no_units, r"radiance_C13 without units: add"),
        (_other_band, r"radiance_C13 band 14: correct"),
        (_cube, r"on time, y, x: select"),
    ],
)
def test_what_cannot_be_read_is_refused_in_one_sentence(tmp_path, write, message):
    path = tmp_path / "x.nc"
    write(path)
    with pytest.raises(DataError, match=message) as caught:
        read_radiances(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_empty_folder_is_refused(tmp_path):
    with pytest.raises(DataError, match=str(tmp_path)):
        read_radiances(tmp_path)


def _band(number, units=VISIBLE, values=(1.0, 2.0)):
    return {number: BandRadiances(number, units, np.array(values))}


@pytest.mark.parametrize(
    ("a", "b", "message"),
    [
        (_band(1), _band(2), "a holds bands 1 and b holds bands 2: give"),
        (_band(1), {}, "b holds no bands"),
        (_band(7), _band(7, THERMAL), f"band 7 in '{VISIBLE}' and b in 'mW.*convert"),
        (_band(1), _band(1, values=(np.nan,)), "b has no valid pixel in band 1: leave"),
    ],
)
def test_sets_that_cannot_be_compared_are_refused(a, b, message):
    with pytest.raises(DataError, match=message):
        compare(a, b, ("a", "b"))


def test_bands_in_only_one_set_are_left_out_aloud():
    a, b = _band(1) | _band(2) | _band(3), _band(3) | _band(2) | _band(5)
    comparison = compare(a, b, ("a", "b"), {"cloudjax": "1"})
    assert [band.number for band in comparison.bands] == [2, 3]
    assert [w.split(" only ")[1] for w in comparison.warnings] == [
        "a holds them: bands 1.",
        "b holds them: bands 5.",
    ]
    assert comparison.versions == {"cloudjax": "1"}


def test_spacing_of_units_is_no_difference():
    a, b = _band(1), _band(1, VISIBLE.replace(" ", "  "))
    assert compare(a, b, ("a", "b")).bands[0].distances.w1 == 0
