"""Real files, against satpy for imagery and eccodes' own values for weather."""

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from cloudjax_data import cf_attributes, open_folder, read_band, read_weather
from cloudjax_data.calibration import EmissiveCalibration


pytestmark = pytest.mark.shared_data

DAY = "goes17_m1_20191027T2000"
NIGHT = "goes17_m1_20191201T1027_night"
GFS = "gfs_2p5deg_20110115T12/gfs.t12z.pgrbf120.2p5deg.grib2"
NAM = "nam_211_20180917T00/nam.t00z.awp21100.tm00.grib2"


def by_satpy(folder, calibration):
    """`{band: DataArray}` by the reader that most users trust."""
    satpy = pytest.importorskip("satpy")
    files = [str(path) for path in sorted(folder.glob("*.nc"))]
    scene = satpy.Scene(reader="abi_l1b", filenames=files)
    names = [name for name in scene.available_dataset_names() if name.startswith("C")]
    if calibration != "radiance":
        names = [name for name in names if int(name[1:]) >= 7]
    scene.load(names, calibration=calibration)
    return {int(name[1:]): scene[name] for name in names}


@pytest.mark.parametrize("name", [DAY, NIGHT])
def test_radiances_and_positions_are_those_of_satpy(shared_data, name):
    folder = shared_data / name
    expected = by_satpy(folder, "radiance")
    paths = open_folder(folder).bands
    assert set(paths) == set(expected)
    for number, path in paths.items():
        band, theirs = read_band(path), expected[number]
        values = theirs.to_numpy()
        np.testing.assert_allclose(
            band.radiance[band.good], values[band.good], rtol=1e-6, atol=0
        )
        # satpy blanks fill values only; we also drop what the quality flag rejects
        assert not np.isnan(values[band.good]).any()
        x, y = theirs.attrs["area"].get_proj_vectors()
        height = band.grid.perspective_height_m
        np.testing.assert_allclose(band.grid.x_rad, x / height, rtol=0, atol=5e-9)
        np.testing.assert_allclose(band.grid.y_rad, y / height, rtol=0, atol=5e-9)


def test_positions_on_the_globe_are_those_of_satpy(shared_data):
    import pyproj

    folder = shared_data / DAY
    band = read_band(open_folder(folder).bands[13])
    area = by_satpy(folder, "radiance")[13].attrs["area"]
    longitude, latitude = area.get_lonlats()
    height = band.grid.perspective_height_m
    to_degrees = pyproj.Proj(pyproj.CRS.from_cf(cf_attributes(band.grid)))
    x, y = np.meshgrid(band.grid.x_rad * height, band.grid.y_rad * height)
    ours = to_degrees(x, y, inverse=True)
    np.testing.assert_allclose(ours[0], longitude, rtol=0, atol=1e-6)
    np.testing.assert_allclose(ours[1], latitude, rtol=0, atol=1e-6)


def test_brightness_temperatures_are_those_of_satpy(shared_data):
    folder = shared_data / NIGHT
    paths = open_folder(folder).bands
    for number, theirs in by_satpy(folder, "brightness_temperature").items():
        band = read_band(paths[number])
        assert isinstance(band.calibration, EmissiveCalibration)
        temperature = band.calibration.brightness_temperature_k(band.radiance)
        np.testing.assert_allclose(
            temperature[band.good], theirs.to_numpy()[band.good], atol=2e-3
        )


def test_the_day_scene(shared_data):
    folder = open_folder(shared_data / DAY)
    assert sorted(folder.bands) == [1, *range(3, 17)]
    scene = folder.read([1, 3, 13])
    assert abs((scene.time - datetime(2019, 10, 27, 20, 0, 30, tzinfo=UTC)).seconds) < 2
    common = scene.on_common_grid()
    assert common.grid.shape == (500, 500)
    assert common.grid.subsatellite_longitude_deg == -137.0
    assert min(band.good.mean() for band in common.bands.values()) > 0.9999
    for band in common.bands.values():
        assert np.isfinite(band.radiance[band.good]).all()


def test_night_noise_stays_negative(shared_data):
    band = open_folder(shared_data / NIGHT).read([1]).bands[1]
    assert (band.radiance < 0).sum() > 1000


def test_products_are_listed(shared_data):
    folder = open_folder(shared_data / "goes16_cod_acha_20220701T0002")
    assert sorted(folder.products) == ["ACHA", "COD"]
    assert (folder.platform, folder.sector, folder.bands) == ("G16", "C", {})


def raw_values(path: Path, name: str, level: int) -> np.ndarray:
    """The values of one message in the order of the file."""
    import eccodes

    # u and v of the GFS file share a message
    eccodes.codes_grib_multi_support_on()
    keys = {"shortName": name, "level": level, "typeOfLevel": "isobaricInhPa"}
    with path.open("rb") as stream:
        while (message := eccodes.codes_grib_new_from_file(stream)) is not None:
            if all(eccodes.codes_get(message, k) == v for k, v in keys.items()):
                return eccodes.codes_get_values(message)
            eccodes.codes_release(message)
    raise AssertionError(f"{path} has no {name} at {level} hPa")


def test_gfs(shared_data):
    cube = read_weather(shared_data / GFS)
    assert cube.valid_time == datetime(2011, 1, 15, 12, tzinfo=UTC)
    assert cube.is_global
    assert cube.data["level"].size == 21
    # humidity and vertical motion end below the top of the winds
    assert cube.lost_levels_hpa["u"] == (70.0, 50.0, 30.0, 20.0, 10.0)
    assert cube.lost_levels_hpa["r"] == (70.0, 50.0, 30.0, 10.0)
    for name in ("u", "v", "w", "r", "t", "gh", "clwmr"):
        raw = raw_values(cube.path, name, 500).reshape(73, 144)[::-1]
        np.testing.assert_allclose(cube.data[name].sel(level=500.0), raw, rtol=1e-6)


def test_nam(shared_data):
    cube = read_weather(shared_data / NAM)
    assert cube.valid_time == datetime(2018, 9, 17, tzinfo=UTC)
    assert cube.projection is not None
    assert cube.projection.longitude_deg == 265.0
    assert cube.data["level"].size == 19
    for name in ("w", "r", "t", "gh"):
        raw = raw_values(cube.path, name, 850).reshape(65, 93)
        np.testing.assert_allclose(cube.data[name].sel(level=850.0), raw, rtol=1e-6)


def test_nam_winds_are_turned_to_earth(shared_data):
    cube = read_weather(shared_data / NAM)
    u, v = (raw_values(cube.path, name, 300).reshape(65, 93) for name in "uv")
    longitude, latitude = (
        cube.data[name].to_numpy() for name in ("longitude", "latitude")
    )
    # from true north to the y axis, by the positions alone
    angle = np.arctan2(
        np.gradient(longitude, axis=0) * np.cos(np.radians(latitude)),
        np.gradient(latitude, axis=0),
    )
    turned = (u + 1j * v) * np.exp(-1j * angle)
    ours = cube.data["u"].sel(level=300.0) + 1j * cube.data["v"].sel(level=300.0)
    inside = (slice(1, -1), slice(1, -1))
    difference = np.abs(ours.to_numpy() - turned)[inside]
    assert difference.max() < 0.05
    assert np.abs(angle).max() > np.radians(15)


def test_nam_at_an_altitude_on_a_regular_grid(shared_data):
    found = read_weather(shared_data / NAM).regular(1.0).at_altitude(6000.0)
    temperature = found["t"].sel(latitude=37.0, longitude=240.0)
    assert 255.0 < float(temperature) < 275.0
