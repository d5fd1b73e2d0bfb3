"""COD and ACHA files of one scan: native or passed on, and what is refused."""

from datetime import timedelta

import netCDF4
import numpy as np
import pytest

from cloudjax_data import DataError, read_retrieval
from tests.generated_retrieval import (
    BAD,
    NIGHT,
    START,
    scene,
    write_acha,
    write_cod,
    write_retrieval,
)


NONE = np.nan
DEPTH = np.full((20, 20), 8.0)
DEPTH[:5], DEPTH[12, 12] = NONE, 40.0
TOPS = np.array([[NONE] * 4, [9e3, 9e3, 5e3, 2e3], [9e3] * 4, [9e3, NONE, 5e3, 5e3]])


@pytest.mark.parametrize("renamed", [False, True], ids=["native", "passed on"])
def test_depths_and_heights_are_those_of_the_files(tmp_path, renamed):
    found = read_retrieval(write_retrieval(tmp_path, DEPTH, TOPS, renamed=renamed))
    np.testing.assert_allclose(found.optical_depth, np.nan_to_num(DEPTH), atol=2e-3)
    np.testing.assert_array_equal(found.cloudy, ~np.isnan(DEPTH))
    assert found.grid.same_as(scene())
    assert (found.platform, found.sector) == ("G16", "C")
    assert abs(found.time - START - timedelta(seconds=118.5)) < timedelta(seconds=1)
    # Of the coarse pixels that hold them; where that has none, of the nearest.
    assert found.top_m[7, 2] == pytest.approx(9e3, abs=1)
    assert found.top_m[7, 17] == pytest.approx(2e3, abs=1)
    assert found.filled[17, 5:10].all()
    assert found.filled.sum() == 25
    assert found.top_m[15, 5] == pytest.approx(9e3, abs=1)
    assert np.isnan(found.top_m[0]).all()


def test_flags_tell_clear_from_unknown_and_night_from_day(tmp_path):
    flags = np.zeros(DEPTH.shape, int)
    flags[10, :3], flags[15:] = BAD, NIGHT
    write_cod(tmp_path, DEPTH, flags)
    write_acha(tmp_path, np.full((4, 4), 9e3), "ACHA2KM")
    found = read_retrieval(tmp_path)
    assert found.unknown.sum() == 3
    assert not found.cloudy[10, :3].any()
    assert not found.unknown[:5].any()
    assert found.night.sum() == 100
    first, second = found.cautions()
    assert first.startswith("3 of 400 pixels are unknown")
    assert second.startswith("100 of 297 cloudy pixels have an optical depth by")


def test_a_satellite_off_its_positions_is_found_by_the_places(tmp_path):
    """GOES-17 was on trial at 89.5 W."""
    early = START.replace(year=2018, month=8)
    more = {"start": early, "platform": "G17", "renamed": True}
    grids = [
        type(g)(g.x_rad, g.y_rad, -89.5) for g in (scene(20, 20), scene(4, 4, km=10))
    ]
    write_cod(tmp_path, DEPTH, grid=grids[0], **more)
    write_acha(tmp_path, TOPS, grid=grids[1], **more)
    assert read_retrieval(tmp_path).grid.subsatellite_longitude_deg == -89.5


def _without_height(folder):
    write_cod(folder, DEPTH)


def _without_depth(folder):
    write_acha(folder, TOPS)


def _other_scan(folder):
    write_cod(folder, DEPTH)
    write_acha(folder, TOPS, start=START + timedelta(minutes=5))


def _elsewhere(folder):
    write_cod(folder, DEPTH)
    grid = scene(4, 4, km=10)
    write_acha(folder, TOPS, grid=type(grid)(grid.x_rad + 0.02, grid.y_rad, -75.0))


def _no_heights(folder):
    write_retrieval(folder, DEPTH, np.full((4, 4), NONE))


def _broken(folder):
    path = write_cod(folder, DEPTH)
    path.write_bytes(path.read_bytes()[:3000])
    write_acha(folder, TOPS)


def _other_quantity(folder):
    path = write_cod(folder, DEPTH)
    write_acha(folder, TOPS)
    with netCDF4.Dataset(path, "a") as file:
        file["COD"].standard_name = "effective_radius"
        file.renameVariable("COD", "PSD")


def _displaced(folder):
    path = write_retrieval(folder, DEPTH, TOPS, renamed=True)
    with netCDF4.Dataset(next(path.glob("*COD*")), "a") as file:
        file["lon"][:] = file["lon"][:] - 0.2


def _unexplained(folder):
    path = write_cod(folder, DEPTH)
    write_acha(folder, TOPS)
    with netCDF4.Dataset(path, "a") as file:
        file["DQF"].delncattr("flag_meanings")


REFUSED = {
    _without_height: "has no ACHA file: put that of the same scan beside the COD file",
    _without_depth: "has no COD file",
    _other_scan: "holds several scans",
    _elsewhere: "sees none of the pixels",
    _no_heights: "has no height that its flags let count",
    _broken: "cannot be read as netCDF",
    _other_quantity: "has no variable of the standard name",
    _displaced: "its latitudes and longitudes are not those of its scan angles",
    _unexplained: "lacks the 'DQF' attribute 'flag_meanings'",
}


@pytest.mark.parametrize("make", REFUSED, ids=[make.__name__ for make in REFUSED])
def test_what_does_not_serve_is_refused_in_a_sentence(tmp_path, make):
    make(tmp_path)
    with pytest.raises(DataError, match=r"^[^\n]*\.$") as refused:
        read_retrieval(tmp_path)
    assert REFUSED[make] in str(refused.value)


def test_a_clear_scan_has_no_cloud(tmp_path):
    found = read_retrieval(write_retrieval(tmp_path, np.full((20, 20), NONE), TOPS))
    with pytest.raises(DataError, match=r"has no cloud \(0 of 400 pixels are unknown"):
        found.require_cloud()
