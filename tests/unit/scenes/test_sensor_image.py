"""Files and pictures of what a sensor sees, from made-up frames."""

import dataclasses

import numpy as np
import pytest
import xarray as xr

from cloudjax import (
    Camera,
    ClassTexture,
    FixedGrid,
    Gaussian,
    Ladder,
    cloud_classes,
    nominal_bands,
)
from cloudjax_data import DataError, WeatherSeries, read_weather
from cloudjax_scenes.image_strips import render_strips, strips, write_strips
from cloudjax_scenes.sensor_image import (
    SensorImage,
    render_sensor,
    sensor_dataset,
    write_picture,
)
from cloudjax_scenes.sensors import Sensor
from cloudjax_scenes.weather_decision import Table1
from cloudjax_scenes.weather_scene import World
from tests.generated import SCAN_START
from tests.scenes import write_weather


GRID = FixedGrid.abi_meso(10.0, 20.0, -80.0)
CAMERA = Camera(20.0, -80.0, 500e3, 0.0, -90.0, 20.0, 30, 40)
BANDS = nominal_bands()

COARSE = ClassTexture(Ladder(Gaussian(), 225e3, 110e3), 1.0, 0.5, 0.0)


@pytest.fixture(scope="module")
def world(tmp_path_factory) -> World:
    file = write_weather(tmp_path_factory.mktemp("weather"), SCAN_START)
    series = WeatherSeries.of([read_weather(file)])
    return World(series, cloud_classes(), Table1(), seed=5)


def frame(view: FixedGrid | Camera, **given) -> SensorImage:
    """The west is clear, the east cloud of the second class, a corner is space."""
    space = np.zeros(view.shape, bool)
    space[0, 0] = True
    cloudy = np.broadcast_to(np.arange(view.shape[1]) >= 15, view.shape)

    def both(clear, cloud):
        return np.where(space, np.nan, np.where(cloudy, cloud, clear))

    values = {
        "sensor": Sensor("test", "ABI", view, BANDS),
        "time": SCAN_START,
        "radiance": {2: both(20.0, 300.0), 13: both(100.0, 40.0)},
        "latitude_deg": both(20.0, 20.0),
        "longitude_deg": both(-80.0, -80.0),
        "cloud_fraction": both(0.0, 1.0),
        "cloud_optical_depth": both(0.0, 12.0),
        "cloud_top_height_m": both(np.nan, 8000.0),
        "cloud_class": np.where(cloudy & ~space, 2, 0).astype(np.int8),
        "class_names": ("fog", "high cloud"),
    }
    return SensorImage(**(values | given))


@pytest.mark.parametrize("view", [GRID, CAMERA], ids=["grid", "camera"])
def test_a_file_is_read_back_as_it_was(tmp_path, world, view):
    image = frame(view)
    write_strips(tmp_path / "new" / "out.nc", [image], world)
    names = {file.name for file in (tmp_path / "new").iterdir()}
    assert names == {"out.nc", "out.png"}
    with xr.open_dataset(tmp_path / "new" / "out.nc", decode_coords="all") as data:
        for number, values in image.radiance.items():
            found = data[f"radiance_C{number:02d}"]
            np.testing.assert_allclose(found, values, rtol=1e-6)
            assert found.attrs["abi_band"] == number
        np.testing.assert_allclose(data["cloud_top_height"], image.cloud_top_height_m)
        assert data["cloud_class"].dtype == np.int8
        np.testing.assert_array_equal(data["cloud_class"], image.cloud_class)
        # CF separates meanings by blanks.
        assert data["cloud_class"].attrs["flag_meanings"] == "clear fog high_cloud"
        assert data.attrs["seed"] == 5
        assert data.attrs["steps"] == world.steps
        assert data.attrs["nodes"] == world.nodes
        assert data.attrs["shadow_steps"] == 0
        assert data.attrs["thermal_scattering"] == 1
        assert data.attrs["weather"] == "gfs.grib2"
        assert ("latitude" in data.coords) == (view is CAMERA)
        assert ("goes_imager_projection" in data.coords) == (view is GRID)


def test_a_light_that_scatters_no_thermal_radiation_says_so(world):
    paper = dataclasses.replace(world, light="paper")
    data = sensor_dataset(frame(GRID), paper)
    assert data.attrs["light"] == "paper"
    assert data.attrs["thermal_scattering"] == 0


def test_products_of_a_grid_name_their_projection(world):
    data = sensor_dataset(frame(GRID), world)
    for name in ("radiance_C02", "cloud_fraction", "cloud_class"):
        assert data[name].encoding["grid_mapping"] == "goes_imager_projection"


def test_a_picture_is_white_where_it_is_bright_or_cold(tmp_path, world):
    from PIL import Image

    write_picture(tmp_path / "out.png", frame(GRID).bands(), "made up")
    pixels = np.asarray(Image.open(tmp_path / "out.png").convert("L"), int)
    row = pixels[pixels.shape[0] // 2]
    ground, cloud = row[len(row) // 40], row[len(row) // 3]
    assert ground < 60
    assert cloud > 240


def test_a_picture_of_nothing_can_be_drawn(tmp_path):
    dark = {2: np.full(GRID.shape, np.nan)}
    write_picture(tmp_path / "out.png", frame(GRID, radiance=dark).bands(), "dark")
    assert (tmp_path / "out.png").stat().st_size > 0


def test_a_failure_leaves_nothing(tmp_path, world, monkeypatch):
    def full(*_, **__):
        raise OSError("No space left on device")

    monkeypatch.setattr("cloudjax_scenes.image_strips.write_netcdf", full)
    with pytest.raises(DataError, match="free some space"):
        write_strips(tmp_path / "out.nc", [frame(GRID)], world)
    assert list(tmp_path.iterdir()) == []


def test_strips_make_the_whole_and_cameras_are_one():
    sensor = Sensor("test", "ABI", GRID, BANDS)
    parts = strips(sensor, pixels=7 * GRID.shape[1] + 1)
    assert [part.view.shape[0] for part in parts[:-1]] == [7] * (len(parts) - 1)
    rays = np.concatenate([part.view.rays().direction for part in parts])
    np.testing.assert_array_equal(rays, GRID.rays().direction)
    camera = Sensor("test", "none", CAMERA, BANDS)
    assert strips(camera, pixels=1) == [camera]


def test_a_file_of_strips_is_that_of_the_whole(tmp_path, world):
    """One thin class of cloud on a small sector, at once and in strips of five rows."""
    stratus = world.classes["low_stratus"]
    plain = dataclasses.replace(
        stratus,
        textures=(ClassTexture(Ladder(Gaussian(), 225e3, 110e3), 1.0, 0.5, 0.0),),
    )
    quick = dataclasses.replace(world, steps=4, classes={"a": plain})
    sensor = Sensor("test", "ABI", GRID, BANDS)
    done = []
    for name, pixels in (("whole", 1 << 20), ("strips", 5 * GRID.shape[1])):
        images = render_strips(
            quick,
            sensor,
            [BANDS[2]],
            SCAN_START,
            pixels=pixels,
            on_tile=lambda *numbers: done.append(numbers),
        )
        write_strips(tmp_path / f"{name}.nc", images, quick)
    assert done[-1] == (GRID.shape[0] * GRID.shape[1],) * 2
    with (
        xr.open_dataset(tmp_path / "whole.nc", decode_coords="all") as whole,
        xr.open_dataset(tmp_path / "strips.nc", decode_coords="all") as parts,
    ):
        assert parts.sizes == whole.sizes
        assert set(parts.variables) == set(whole.variables)
        assert parts["time"] == whole["time"]
        for name, values in whole.drop_vars("time").variables.items():
            np.testing.assert_allclose(parts[name], values, rtol=1e-4, atol=1e-5)
        assert float(parts["cloud_fraction"].mean()) > 0.01
    sizes = [(tmp_path / f"{n}.png").stat().st_size for n in ("whole", "strips")]
    assert min(sizes) > 0.9 * max(sizes)


def test_a_disc_has_space_around_it_and_clouds_on_it(world):
    """Nine thick pixels, of which the corners miss the Earth."""
    angles = np.array([-0.12, 0.0, 0.12])
    whole = FixedGrid.abi_full_disc(10.0, -75.0)
    view = dataclasses.replace(whole, x_rad=angles, y_rad=angles[::-1])
    stratus = world.classes["low_stratus"]
    plain = dataclasses.replace(
        stratus,
        textures=(ClassTexture(Ladder(Gaussian(), 225e3, 110e3), 1.0, 0.5, 0.0),),
    )
    quick = dataclasses.replace(world, steps=4, classes={"a": plain})
    sensor = Sensor("test", "ABI", view, BANDS)
    image = render_sensor(quick, sensor, [BANDS[13]], SCAN_START)
    seen = np.isfinite(image.latitude_deg)
    assert seen.tolist() == [[False, True, False], [True] * 3, [False, True, False]]
    for values in (image.radiance[13], image.cloud_fraction):
        np.testing.assert_array_equal(np.isfinite(values), seen)
    assert not image.cloud_class[~seen].any()
    # One uniform air mass of 270 K.
    assert image.band(13).shown[seen] == pytest.approx(270, abs=8)


@pytest.mark.parametrize(("hour", "parts"), [(18, 2), (6, 1)], ids=["day", "night"])
def test_band_7_sees_the_sun_by_day_only(world, monkeypatch, hour, parts):
    """20 N 80 W: the sun is high at 18 UTC and far below the horizon at 6 UTC."""
    made = []
    scene_of = World.scene

    def scene(self, *arguments, **options):
        made.append(scene_of(self, *arguments, **options))
        raise StopIteration

    monkeypatch.setattr(World, "scene", scene)
    sensor = Sensor("test", "ABI", GRID, BANDS)
    with pytest.raises(StopIteration):
        render_sensor(world, sensor, [BANDS[7]], SCAN_START.replace(hour=hour))
    assert made[0].bands == (7,)
    assert (made[0].reflective is not None) + (made[0].emissive is not None) == parts
