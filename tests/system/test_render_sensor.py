"""`cloudjax render SENSOR --weather GRIB` as its users meet it."""

from pathlib import Path

import numpy as np
import pyproj
import pytest
import xarray as xr
from PIL import Image, ImageSequence

from cloudjax_fit.fit_files import write_fit
from cloudjax_fit.fit_inputs import read_inputs
from tests.commands import run, sentence_of
from tests.fit_results import made_up_result
from tests.generated_grib import write_grib
from tests.scenes import write_scene
from tests.weather_scenes import (
    CLASS,
    HIGH,
    LEVELS,
    MESO,
    NOON,
    SMALL,
    inputs,
    render_image,
)


@pytest.fixture
def folder(weather_folder) -> Path:
    return weather_folder


def test_the_file_has_what_is_promised(rendered):
    assert rendered.with_suffix(".png").read_bytes().startswith(b"\x89PNG")
    units = {
        "radiance_C02": "W m-2 sr-1 um-1",
        "radiance_C13": "mW m-2 sr-1 (cm-1)-1",
        "reflectance_C02": "1",
        "brightness_temperature_C13": "K",
        "cloud_top_height": "m",
        "cloud_optical_depth": "1",
        "cloud_fraction": "1",
    }
    with xr.open_dataset(rendered) as data:
        assert data.attrs["Conventions"] == "CF-1.8"
        assert data.attrs["weather"] == "gfs.grib2"
        assert data["time"] == np.datetime64("2019-10-27T18:00")
        for name, unit in units.items():
            assert data[name].dims == ("y", "x")
            assert data[name].attrs["units"] == unit
        assert data["cloud_class"].attrs["flag_meanings"] == "clear low high"
        np.testing.assert_array_equal(
            data["cloud_class"].attrs["flag_values"], range(3)
        )


def test_the_clouds_agree_with_each_other(rendered):
    with xr.open_dataset(rendered) as data:
        kind, height = data["cloud_class"].to_numpy(), data["cloud_top_height"]
        fraction = data["cloud_fraction"].to_numpy()
        assert set(np.unique(kind)) == {0, 1, 2}
        assert fraction.min() >= 0
        assert 0.2 < fraction.mean() < 0.9
        assert np.isnan(height.to_numpy()[kind == 0]).all()
        # A pixel with both has a height between.
        assert float(height.where(kind == 2).mean()) > 5000
        assert float(height.where(kind == 1).mean()) < 3000
        c02, c13 = (data[f"radiance_C{n}"].to_numpy() for n in ("02", "13"))
        clear = fraction < 0.05
        assert c02[fraction > 0.95].mean() > 3 * c02[clear].mean()
        assert c13[kind == 2].mean() < c13[clear].mean()


def test_low_cloud_shines_at_4_micrometres_by_day(rendered):
    """One row: droplets return the sun and emit; crystals are darker and colder."""
    with xr.open_dataset(rendered) as data:
        assert "reflectance_C07" not in data
        kind, whole = data["cloud_class"], data["cloud_fraction"] > 0.95
        warmer = data["brightness_temperature_C07"] - data["brightness_temperature_C13"]
        low = float(warmer.where(whole & (kind == 1)).mean())
        clear = float(warmer.where(data["cloud_fraction"] < 0.05).mean())
    assert 0 < clear < 8
    assert low > clear + 10


def test_a_quantity_that_no_band_has_is_refused(folder):
    asked = "--bands", "13", "--quantity", "reflectance", "-o", folder / "none.nc"
    result = run("render", *MESO, *inputs(folder), *asked)
    assert "No band of 13 has a reflectance" in sentence_of(result)
    assert not (folder / "none.nc").exists()


def test_the_projection_is_that_of_the_satellite(rendered):
    with xr.open_dataset(rendered) as data:
        mapping = data[data["radiance_C02"].attrs["grid_mapping"]]
        crs = pyproj.CRS.from_cf(mapping.attrs)
    # GOES-R PUG volume 3, table 5.1.2.7.
    geos = pyproj.CRS.from_proj4(
        "+proj=geos +h=35786023 +lon_0=-75 +sweep=x +a=6378137 +b=6356752.31414"
    )
    place = np.array([-80.0, -120.0]), np.array([20.0, -35.0])
    ours, theirs = (pyproj.Proj(one)(*place) for one in (crs, geos))
    np.testing.assert_allclose(ours, theirs, atol=1e-3)


def test_the_file_opens_as_an_area(rendered):
    utils = pytest.importorskip("pyresample.utils.cf")
    area, _ = utils.load_cf_area(str(rendered), variable="radiance_C02")
    longitude, latitude = area.get_lonlats()
    geod = pyproj.Transformer.from_crs(area.crs, area.crs.geodetic_crs, always_xy=True)
    with xr.open_dataset(rendered) as data:
        x, y = np.meshgrid(data["x"] * 35786023.0, data["y"] * 35786023.0)
    λ, φ = geod.transform(x, y)
    np.testing.assert_allclose(latitude, φ, atol=1e-4)
    np.testing.assert_allclose(longitude, λ, atol=1e-4)
    # 20 N, 80 W, to the nearest multiple of 20 km.
    row, column = np.array(latitude.shape) // 2
    assert latitude[row, column] == pytest.approx(20, abs=0.2)
    assert longitude[row, column] == pytest.approx(-80, abs=0.2)


def test_the_same_seed_gives_the_same_values(rendered, folder):
    file = render_image(folder, folder / "again.nc")
    with xr.open_dataset(rendered) as first, xr.open_dataset(file) as second:
        xr.testing.assert_identical(first, second)


def test_a_camera_sees_a_sky_above_the_ground(folder):
    (folder / "leo.toml").write_text(
        'kind = "camera"\nlatitude_deg = 15.0\nlongitude_deg = -80.0\n'
        "altitude_m = 500e3\nazimuth_deg = 0.0\nelevation_deg = -20.0\n"
        "field_of_view_deg = 30.0\nrows = 40\ncolumns = 30\nbands = [13]\n"
    )
    file = folder / "leo.nc"
    result = run("render", folder / "leo.toml", *inputs(folder), "-o", file)
    assert result.exit_code == 0, result.output
    with xr.open_dataset(file) as data:
        assert data.attrs["sensor"] == "leo"
        assert data["radiance_C13"].shape == (40, 30)
        ground = np.isfinite(data["latitude"].to_numpy())
        # The horizon of 500 km is 22 degrees below the horizontal.
        assert not ground[:16].any()
        assert ground[24:].all()
        assert np.isfinite(data["radiance_C13"].to_numpy()[ground]).all()
        assert np.isnan(data["radiance_C13"].to_numpy()[0]).all()
        assert set(data.coords) >= {"latitude", "longitude", "time"}


def test_frames_follow_each_other(folder):
    later = "--weather", folder / "later.grib2"
    # The bands of `rendered`, whose compiled functions serve here, too.
    clip = "--frames", "2", "--minutes", "90", "--bands", "2,7,13", "--animation", "gif"
    file = folder / "clip.nc"
    result = run("render", *MESO, *inputs(folder), *later, *clip, "-o", file)
    assert result.exit_code == 0, result.output
    assert not file.exists()
    with (
        xr.open_dataset(folder / "clip-000.nc") as first,
        xr.open_dataset(folder / "clip-001.nc") as second,
    ):
        assert second["time"] - first["time"] == np.timedelta64(90, "m")
        assert second.attrs["weather"] == "gfs.grib2, later.grib2"
        with Image.open(folder / "clip.gif") as film:
            assert len(list(ImageSequence.Iterator(film))) == 2
        # Drier by then.
        assert second["cloud_fraction"].mean() < first["cloud_fraction"].mean()


def test_a_fifth_class_is_a_matter_of_toml(folder):
    classes = folder / "fifth.toml"
    anvil = HIGH | {"name": "anvil", "sampled": 9500, "shell_top": 14000, "top": 12000}
    text = (folder / "classes.toml").read_text() + CLASS.format(**anvil)
    classes.write_text(text)
    file = folder / "fifth.nc"
    options = "--weather", folder / "gfs.grib2", "--classes", classes, *SMALL
    options += "--decision", "table1"
    result = run("render", *MESO, *options, "--bands", "13", "-o", file)
    assert result.exit_code == 0, result.output
    with xr.open_dataset(file) as data:
        assert data["cloud_class"].attrs["flag_meanings"] == "clear low high anvil"
        assert (data["cloud_class"] == 3).any()


GIVEN = ("--weather", "gfs.grib2", "--classes", "classes.toml")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (MESO, "give --weather"),
        (("abi-fulldisc-10km", *GIVEN), "abi-fulldisc-10km is not a sensor"),
        (("nothing.toml", *GIVEN), "nothing.toml"),
        (("abi-meso-10km", *GIVEN), "without a place"),
        ((*MESO, *GIVEN, "--time", "2019-10-28T09:00"), "hours from 2019-10-28 09:00"),
        ((*MESO, *GIVEN, "--frames", "9"), "hours from 2019-10-27 22:00"),
        ((*MESO, *GIVEN, "--steps", "0"), "--steps"),
        ((*MESO, *GIVEN, "--seed", "-1"), "seed = -1"),
        ((*MESO, *GIVEN, "--minutes", "0"), "--minutes"),
        ((*MESO, *GIVEN, "--shadows", "6", "--light", "paper"), "use --light physical"),
        ((*MESO, *GIVEN, "--ignore-weather"), "leave out --ignore-weather"),
        ((*MESO, *GIVEN, "--parameters", "p.toml"), "leave out --parameters"),
        (("abi-meso-10km", *GIVEN, "--centre", "20"), "'20'"),
        (("abi-meso-10km", *GIVEN, "--centre", "20,105"), "abi-meso-10km"),
        (("abi-conus-10km", *GIVEN, "--centre", "20,-80"), "leave it out"),
        ((*MESO, *GIVEN[:3], "unknown.toml"), "unknown key, 'toop'"),
        ((*MESO, *GIVEN[:3], "empty.toml"), "holds no class"),
        ((*MESO, *GIVEN[:3], "absent.toml"), "absent.toml is not a file"),
        ((*MESO, *GIVEN[:3], "binary.toml"), "binary.toml is text in UTF-16"),
        ((*MESO, "--weather", "absent.grib2"), "absent.grib2"),
        ((*MESO, "--weather", "region.grib2"), "covers a region only"),
        ((*MESO, *GIVEN, "--weather", "gfs.grib2"), "both valid at"),
        (("two.toml", *GIVEN, "--bands", "3"), "has no band 3"),
        ((".", "--time", "2019-10-27T18:00"), "leave out --time"),
    ],
)
def test_bad_input_is_one_sentence(folder, tmp_path, monkeypatch, arguments, words):
    monkeypatch.chdir(folder)
    text = Path("classes.toml").read_text()
    Path("unknown.toml").write_text(text.replace("top_m", "toop", 1))
    Path("empty.toml").write_text("")
    Path("two.toml").write_text(
        'kind = "abi"\nsector = "fulldisk"\nresolution_km = 10\nbands = [2, 13]\n'
    )
    Path("binary.toml").write_bytes(b"\xff\xfe\x00")
    regional(Path("region.grib2"))
    sentence = sentence_of(run("render", *arguments, "-o", tmp_path / "out.nc"))
    assert words in sentence
    assert list(tmp_path.iterdir()) == []


def test_classes_that_a_fit_found_stand_in_weather(folder, tmp_path):
    """Its parameters.toml is taken as it is, air and light and all."""
    found = read_inputs(write_scene(tmp_path / "scene"))
    write_fit(made_up_result(found), tmp_path / "fit")
    image = tmp_path / "out.nc"
    given = "--weather", folder / "gfs.grib2", "--steps", "4", "--bands", "2,13"
    given += "--decision", "table1"
    classes = "--classes", tmp_path / "fit" / "parameters.toml"
    result = run("render", *MESO, *given, *classes, "-o", image)
    assert result.exit_code == 0, result.output
    with xr.open_dataset(image) as data:
        classes = "clear cirrus thick_cold low_stratus"
        assert data["cloud_class"].attrs["flag_meanings"] == classes
        assert float(data["cloud_fraction"].max()) > 0.5


def regional(file: Path) -> None:
    if file.exists():
        return
    latitude, longitude = np.arange(40.0, 9.0, -10.0), np.arange(260.0, 301.0, 10.0)
    shape = latitude.size, longitude.size
    values = {"u": 5.0, "v": 1.0, "w": 0.1, "r": 60.0, "t": 270.0}
    fields = {
        (name, level): np.full(shape, value)
        for name, value in values.items()
        for level in LEVELS
    } | {("gh", level): np.full(shape, height) for level, height in LEVELS.items()}
    write_grib(file, fields, latitude_deg=latitude, longitude_deg=longitude, time=NOON)
