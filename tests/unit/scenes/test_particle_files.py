"""Particles as files, read back by other readers."""

import numpy as np
import pytest
import xarray as xr

from cloudjax.particles.placement import place
from cloudjax_data import DataError, open_wrf, read_wrf
from cloudjax_scenes.model_columns import depth_columns, extinction_per_m
from cloudjax_scenes.particle_files import local_position_m, write_particles
from tests.generated_wrf import COLUMNS, LEVELS, ROWS, write_wrf


@pytest.fixture(scope="module")
def columns(tmp_path_factory):
    path = write_wrf(tmp_path_factory.mktemp("wrf") / "wrfout")
    return read_wrf(open_wrf(path).frames[0], centre=(20.0, 10.0))


@pytest.fixture(scope="module")
def particles(columns):
    return place(depth_columns(columns), 500)


def test_optical_depth_is_that_of_the_water(columns):
    """Droplets of 10 µm take 3/(2 r) of their volume, and a few per cent more."""
    (water,) = columns.condensate
    found = depth_columns(columns).depth[1]
    expected = 1.5 * water.content_g_m3[1] * 1e-6 / 10e-6 * 1000
    assert (found / expected).min() > 1.02
    assert (found / expected).max() < 1.12
    np.testing.assert_allclose(extinction_per_m(water)[1] * 1000, found, rtol=1e-5)


def test_netcdf_holds_what_the_particles_are(tmp_path, particles):
    path = tmp_path / "p.nc"
    write_particles(path, particles)
    with xr.open_dataset(path) as data:
        assert data.attrs["featureType"] == "point"
        np.testing.assert_array_equal(data["latitude"], particles.latitude_deg)
        np.testing.assert_array_equal(data["altitude"], particles.altitude_m)
        np.testing.assert_allclose(
            data["extinction_area"], particles.extinction_area_m2, rtol=1e-6
        )
        np.testing.assert_allclose(data["opacity"], particles.opacity, rtol=1e-6)
        # The wind of the file is 10 m/s along x; its map is a plane, nearly.
        np.testing.assert_allclose(data["eastward_wind"], 10.0, rtol=1e-3)
        assert {data[n].attrs["units"] for n in ("radius", "altitude")} == {"m"}


def test_ply_is_read_by_its_header(tmp_path, particles):
    """As other programs do: names and types from the header, then records."""
    path = tmp_path / "p.ply"
    write_particles(path, particles)
    header, body = path.read_bytes().split(b"end_header\n")
    lines = header.decode("ascii").splitlines()
    assert lines[:2] == ["ply", "format binary_little_endian 1.0"]
    assert "element vertex 500" in lines
    names = [line.split()[2] for line in lines if line.startswith("property float ")]
    table = np.frombuffer(body, [(name, "<f4") for name in names])
    assert len(table) == 500
    position, place_deg = local_position_m(particles)
    assert f"latitude {place_deg[0]:.6f}" in header.decode("ascii")
    for axis, values in zip("xyz", position.T, strict=True):
        np.testing.assert_allclose(table[axis], values, rtol=1e-6, atol=1e-3)
    # The domain is some 20 km wide, with cloud from 1 to 2 km.
    assert np.ptp(table["x"]) == pytest.approx(3000 * COLUMNS, rel=0.1)
    assert np.ptp(table["y"]) == pytest.approx(3000 * ROWS, rel=0.1)
    assert 900 < table["z"].min() < table["z"].max() < 2100
    np.testing.assert_allclose(table["radius"], particles.radius_m, rtol=1e-6)


def test_what_cannot_be_written_is_told(tmp_path, particles):
    with pytest.raises(DataError, match=r"neither in \.nc nor in \.ply"):
        write_particles(tmp_path / "p.vtk", particles)
    assert not list(tmp_path.iterdir())


def test_a_clear_time_has_no_particles(tmp_path):
    path = write_wrf(tmp_path / "clear", QCLOUD=np.zeros((LEVELS, ROWS, COLUMNS)))
    clear = read_wrf(open_wrf(path).frames[0], centre=(20.0, 10.0))
    with pytest.raises(DataError, match="no cloud"):
        depth_columns(clear)
