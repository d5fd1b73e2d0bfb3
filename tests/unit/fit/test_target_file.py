"""Targets survive their file: exactly, or to float32 where that is enough."""

import dataclasses

import numpy as np
import pytest
from tests.scenes import NIGHT, write_scene

from cloudjax_data import DataError
from cloudjax_fit.embedded import FILE, embedded_target
from cloudjax_fit.scene_run import prepare
from cloudjax_fit.target_file import read_target, write_target
from cloudjax_scenes.cloud_rule import CloudRule


@pytest.fixture(scope="module")
def target(tmp_path_factory):
    return prepare(write_scene(tmp_path_factory.mktemp("scene"))).target


def test_a_target_comes_back(target, tmp_path):
    write_target(tmp_path / "target.nc", target)
    back = read_target(tmp_path / "target.nc")
    for name in ("name", "platform", "time", "rule", "blocks"):
        assert getattr(back, name) == getattr(target, name)
    _same_exactly(back, target, ["latitude_deg", "longitude_deg"])
    _same_exactly(back, target, ["block_cloud", "block_valid"])
    assert list(back.fractions) == list(target.fractions)
    for name, fraction in target.fractions.items():
        np.testing.assert_allclose(back.fractions[name], fraction, rtol=1e-6)


def test_the_geometry_comes_back_in_full(target, tmp_path):
    write_target(tmp_path / "target.nc", target)
    back = read_target(tmp_path / "target.nc").grid
    _same_exactly(back, target.grid, ["x_rad", "y_rad"])
    for field in dataclasses.fields(back):
        if not field.name.endswith("_rad"):
            assert getattr(back, field.name) == getattr(target.grid, field.name)


def test_its_bands_come_back(target, tmp_path):
    write_target(tmp_path / "target.nc", target)
    back = read_target(tmp_path / "target.nc").bands
    assert list(back) == list(target.bands)
    for number, band in target.bands.items():
        same = back[number]
        for name in ("number", "wavelength_um", "units", "coefficients", "low", "high"):
            assert getattr(same, name) == getattr(band, name)
        _same_exactly(same, band, ["block_counts"])
        _same_exactly(same.quantiles, band.quantiles, ["probabilities", "count"])
        np.testing.assert_allclose(same.background, band.background, rtol=1e-6)
        np.testing.assert_allclose(
            same.quantiles.values, band.quantiles.values, rtol=1e-6, atol=1e-6
        )


def test_half_a_rule_comes_back(tmp_path):
    scene = write_scene(tmp_path / "night", bands=(13,), start=NIGHT)
    target = prepare(scene).target
    write_target(tmp_path / "target.nc", target)
    rule = read_target(tmp_path / "target.nc").rule
    assert rule == target.rule == CloudRule(None, np.inf, 13, 270.0)


def test_other_files_are_refused(tmp_path):
    path = tmp_path / "target.nc"
    with pytest.raises(DataError, match=r"target\.nc cannot be read"):
        read_target(path)
    path.write_bytes(b"CDF")
    with pytest.raises(DataError, match=r"target\.nc cannot be read"):
        read_target(path)
    abi = next(write_scene(tmp_path / "scene", bands=(13,)).iterdir())
    with pytest.raises(DataError, match="holds no target"):
        read_target(abi)


def test_a_failed_write_leaves_nothing(target, tmp_path, monkeypatch):
    def full_disk(*_, **__):
        raise RuntimeError("NetCDF: HDF error")

    monkeypatch.setattr("xarray.DataTree.to_netcdf", full_disk)
    with pytest.raises(DataError, match="free some space"):
        write_target(tmp_path / "out" / "target.nc", target)
    assert not list((tmp_path / "out").iterdir())


def test_the_embedded_scene_is_small_and_whole():
    from importlib.resources import files

    assert len((files("cloudjax_fit.embedded") / FILE).read_bytes()) <= 500_000
    target = embedded_target()
    assert (target.platform, list(target.bands)) == ("G17", [1, 3, 13])
    assert target.grid.shape == (500, 500)
    assert list(target.fractions) == ["cirrus", "low_stratus"]
    assert 0.2 < target.cloud_fraction < 0.25


def _same_exactly(a, b, names):
    for name in names:
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
