"""Targets survive their file: exactly, or to float32 where that is enough."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr
from tests.scenes import NIGHT, write_scene

from cloudjax_data import DataError
from cloudjax_fit.embedded import FILE, embedded_target
from cloudjax_fit.fit_inputs import read_inputs
from cloudjax_fit.target_file import read_target, write_target
from cloudjax_scenes.cloud_rule import CloudRule


@pytest.fixture(scope="module")
def target(tmp_path_factory):
    return read_inputs(write_scene(tmp_path_factory.mktemp("scene"))).target


def test_a_target_comes_back(target, tmp_path):
    write_target(tmp_path / "target.nc", target)
    back = read_target(tmp_path / "target.nc")
    assert back.blocks == target.blocks
    _same_exactly(back, target, ["block_valid", "good"])
    read, written = back.imagery, target.imagery
    for name in ("name", "platform", "time", "rule", "earth_sun_distance_au"):
        assert getattr(read, name) == getattr(written, name)
    _same_exactly(read, written, ["latitude_deg", "longitude_deg"])
    assert read.background.grid == written.background.grid == read.grid
    for found, given, most in (
        (read.fractions, written.fractions, 6e-4),
        (read.background.radiance, written.background.radiance, 0.0),
    ):
        assert list(found) == list(given)
        for name, field in given.items():
            np.testing.assert_allclose(found[name], field, rtol=1e-6, atol=most)


def test_the_geometry_comes_back_in_full(target, tmp_path):
    write_target(tmp_path / "target.nc", target)
    back, grid = read_target(tmp_path / "target.nc").imagery.grid, target.imagery.grid
    _same_exactly(back, grid, ["x_rad", "y_rad"])
    for field in dataclasses.fields(back):
        if not field.name.endswith("_rad"):
            assert getattr(back, field.name) == getattr(grid, field.name)


def test_its_bands_come_back(target, tmp_path):
    write_target(tmp_path / "target.nc", target)
    back = read_target(tmp_path / "target.nc")
    assert back.imagery.bands == target.imagery.bands
    assert list(back.quantiles) == list(target.quantiles)
    for number, table in target.quantiles.items():
        same = back.quantiles[number]
        _same_exactly(same, table, ["probabilities", "count"])
        np.testing.assert_allclose(same.values, table.values, rtol=1e-6, atol=1e-6)


def test_its_statistics_come_back(target, tmp_path):
    """Sums to a tenth of a pixel, the rest to the last digit."""
    write_target(tmp_path / "target.nc", target)
    back, given = read_target(tmp_path / "target.nc").statistics, target.statistics
    assert back.lags == given.lags == (1, 2, 4)
    assert jax.tree.structure(back) == jax.tree.structure(given)
    for found, written in zip(back.all, given.all, strict=True):
        np.testing.assert_allclose(found.observed, written.observed, atol=0.051)
    plain = [
        eqx.tree_at(lambda s: [x.observed for x in s.all], s, replace_fn=jnp.zeros_like)
        for s in (back, given)
    ]
    for found, written in zip(*map(jax.tree.leaves, plain), strict=True):
        np.testing.assert_array_equal(found, written)


def test_its_evidence_comes_back(target, tmp_path):
    write_target(tmp_path / "target.nc", target)
    back = read_target(tmp_path / "target.nc").imagery.evidence
    assert list(back) == list(target.imagery.evidence) != []
    for name, told in target.imagery.evidence.items():
        _same_exactly(back[name], told, ["latitude_deg", "longitude_deg", "top_m"])
        np.testing.assert_allclose(back[name].nodes, told.nodes, atol=6e-4)


def test_half_a_rule_comes_back(tmp_path):
    scene = write_scene(tmp_path / "night", bands=(13,), start=NIGHT)
    target = read_inputs(scene).target
    write_target(tmp_path / "target.nc", target)
    rule = read_target(tmp_path / "target.nc").imagery.rule
    assert rule == target.imagery.rule == CloudRule(None, np.inf, 13, 270.0)


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

    assert len((files("cloudjax_fit.embedded") / FILE).read_bytes()) <= 600_000
    target = embedded_target()
    imagery = target.imagery
    assert (imagery.platform, list(imagery.bands)) == ("G17", [1, 3, 13])
    assert imagery.grid.shape == (500, 500)
    assert list(imagery.fractions) == ["cirrus", "low_stratus"]
    with xr.open_dataset(
        str(files("cloudjax_fit.embedded") / FILE), group="C01"
    ) as band:
        kappa0 = band.attrs["coefficient_kappa0"]
    assert imagery.coefficients(1)["kappa0"] == pytest.approx(kappa0, rel=1e-12)
    assert 0.2 < target.cloud_fraction < 0.25


def _same_exactly(a, b, names):
    for name in names:
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
