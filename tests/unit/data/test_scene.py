"""Bands of one scan, averaged onto one grid."""

from dataclasses import replace
from datetime import timedelta

import numpy as np
import pytest
import xarray as xr

from cloudjax_data import AbiScene, DataError, read_band, to_dataset
from tests.generated import SCAN_START, window, write_abi_l1b


def scene_of(folder, radiance, **options):
    return AbiScene(
        {
            number: read_band(
                write_abi_l1b(folder, band=number, radiance=values, **options)
            )
            for number, values in radiance.items()
        }
    )


@pytest.fixture
def scene(tmp_path):
    rng = np.random.default_rng(0)
    radiance = {
        2: rng.uniform(50.0, 400.0, (12, 16)),
        3: rng.uniform(20.0, 300.0, (6, 8)),
        13: rng.uniform(20.0, 120.0, (3, 4)),
    }
    radiance[2][0, 0] = np.nan
    return scene_of(tmp_path, radiance)


def test_a_block_is_the_mean_of_its_pixels(scene):
    common = scene.on_common_grid()
    assert list(common.bands) == [2, 3, 13]
    assert common.grid.shape == (3, 4)
    fine = scene.bands[2].radiance[8:12, 4:8]
    np.testing.assert_allclose(common.bands[2].radiance[2, 1], fine.mean(), rtol=1e-6)
    np.testing.assert_array_equal(common.bands[13].radiance, scene.bands[13].radiance)


def test_a_block_is_good_only_if_all_its_pixels_are(scene):
    common = scene.on_common_grid([2, 13])
    expected = np.ones((3, 4), bool)
    expected[0, 0] = False
    np.testing.assert_array_equal(common.bands[2].good, expected)
    np.testing.assert_array_equal(np.isnan(common.bands[2].radiance), ~expected)


def test_the_coarsest_of_the_chosen_bands_decides(scene):
    assert scene.on_common_grid([2, 3]).grid.shape == (6, 8)


def test_identity(scene):
    assert (scene.platform, scene.sector) == ("G17", "M1")
    assert scene.start == SCAN_START
    assert scene.time == SCAN_START + timedelta(seconds=2.85)


def test_bands_of_different_resolution_have_no_grid(scene):
    with pytest.raises(DataError, match="common grid"):
        _ = scene.grid


def test_bands_not_read_are_named(scene):
    with pytest.raises(DataError, match=r"without bands \[7\].*\[2, 3, 13\]"):
        scene.on_common_grid([3, 7])
    with pytest.raises(DataError, match="at least one band"):
        scene.on_common_grid([])


def test_grids_that_do_not_nest_are_refused(tmp_path):
    fine = read_band(
        write_abi_l1b(
            tmp_path,
            band=3,
            radiance=np.ones((6, 8)),
            grid=window((6, 8), 2.8e-5, west_edge_rad=0.024668),
        )
    )
    coarse = read_band(write_abi_l1b(tmp_path, band=13, radiance=np.ones((3, 4))))
    with pytest.raises(DataError, match="do not nest"):
        AbiScene({3: fine, 13: coarse}).on_common_grid()


@pytest.mark.parametrize(
    "change",
    [
        {"platform": "G16"},
        {"sector": "M2"},
        {"start": SCAN_START + timedelta(seconds=30)},
        {"grid": window((3, 4), subsatellite_longitude_deg=-75.0)},
    ],
)
def test_scans_are_not_mixed(scene, change):
    other = replace(scene.bands[13], **change)
    with pytest.raises(DataError, match="not of one scan"):
        AbiScene({3: scene.bands[3], 13: other})


def test_dataset_survives_a_file(scene, tmp_path):
    common = scene.on_common_grid()
    to_dataset(common).to_netcdf(tmp_path / "scene.nc")
    with xr.open_dataset(tmp_path / "scene.nc") as back:
        assert back.attrs["Conventions"] == "CF-1.8"
        np.testing.assert_array_equal(back["radiance_C02"], common.bands[2].radiance)
        assert back["radiance_C02"].attrs["units"] == "W m-2 sr-1 um-1"
        assert back["radiance_C13"].attrs["units"] == "mW m-2 sr-1 (cm-1)-1"
        assert back["radiance_C13"].attrs["grid_mapping"] == "goes_imager_projection"
        assert back["t"].to_numpy() == np.datetime64("2019-10-27T20:00:30.350")
