"""Sensors by name and from TOML, and what is wrong with those that are refused."""

import numpy as np
import pytest

from cloudjax import Camera, FixedGrid, nominal_bands
from cloudjax_data import DataError
from cloudjax_scenes.sensors import SENSOR_NAMES, read_sensor


CAMERA = """
kind = "camera"
latitude_deg = 25
longitude_deg = -88.5
altitude_m = 500e3
azimuth_deg = 10.0
elevation_deg = -80.0
field_of_view_deg = 5.0
rows = 30
columns = 40
"""


def write(folder, text: str):
    path = folder / "sensor.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("name", SENSOR_NAMES)
def test_every_name_is_a_sensor(name):
    centre = (30.0, -90.0) if "meso" in name else None
    sensor = read_sensor(name, centre=centre)
    assert sensor.name == name
    assert list(sensor.bands) == list(range(1, 17))
    assert isinstance(sensor.view, FixedGrid)
    step = abs(sensor.view.x_rad[1] - sensor.view.x_rad[0])
    assert f"{step / 28e-6:.3g}km" == name.split("-")[-1]


def test_a_named_sensor_moves_with_its_satellite():
    sensor = read_sensor(
        "abi-meso-1km", subsatellite_longitude_deg=-137.0, centre=(36.0, -120.0)
    )
    assert isinstance(sensor.view, FixedGrid)
    expected = FixedGrid.abi_meso(1.0, 36.0, -120.0, -137.0)
    assert sensor.view.shape == (1000, 1000)
    assert sensor.view.subsatellite_longitude_deg == -137.0
    np.testing.assert_array_equal(sensor.view.x_rad, expected.x_rad)
    conus = read_sensor("abi-conus-4km").view
    assert isinstance(conus, FixedGrid)
    np.testing.assert_array_equal(conus.x_rad, FixedGrid.abi_conus(4.0).x_rad)


def test_nominal_bands_agree_with_planck():
    """fk1 = c1 ν³ and fk2 = c2 ν; 300 K of band 13 is 105.09 in its units."""
    bands = nominal_bands()
    for band in bands.values():
        assert band.sunlit == ("kappa0" in band.coefficients())
        assert band.reflective == ("fk1" not in band.coefficients())
    c = bands[13].coefficients()
    radiance = c["fk1"] / np.expm1(c["fk2"] / (c["bc1"] + c["bc2"] * 300.0))
    assert radiance == pytest.approx(105.09121, rel=1e-6)
    assert bands[13].units == "mW m-2 sr-1 (cm-1)-1"
    assert bands[2].units == "W m-2 sr-1 um-1"
    assert bands[2].name == "C02"
    near, far = (bands[2].coefficients(d)["kappa0"] for d in (0.98, 1.02))
    assert bands[2].coefficients()["kappa0"] == pytest.approx(np.pi / 1631.3351)
    assert far / near == pytest.approx((1.02 / 0.98) ** 2)


def test_a_camera_from_toml(tmp_path):
    sensor = read_sensor(write(tmp_path, CAMERA + "bands = [13, 2]\nroll_deg = 3.0\n"))
    assert sensor.name == "sensor"
    assert sensor.view == Camera(
        25.0, -88.5, 500e3, 10.0, -80.0, 5.0, rows=30, columns=40, roll_deg=3.0
    )
    assert list(sensor.bands) == [2, 13]


def test_a_camera_that_looks_at_a_target(tmp_path):
    aimed = CAMERA.replace("azimuth_deg", "target_latitude_deg")
    aimed = aimed.replace("elevation_deg", "target_longitude_deg")
    view = read_sensor(write(tmp_path, aimed)).view
    assert isinstance(view, Camera)
    expected = Camera.looking_at(
        25.0,
        -88.5,
        500e3,
        target_latitude_deg=10.0,
        target_longitude_deg=-80.0,
        field_of_view_deg=5.0,
        rows=30,
        columns=40,
    )
    assert view == expected


def test_an_abi_from_toml_with_bands_of_its_own(tmp_path):
    text = """
    kind = "abi"
    name = "west"
    platform = "G17"
    sector = "conus"
    resolution_km = 2
    subsatellite_longitude_deg = -137.0
    [[bands]]
    number = 1
    wavelength_um = 0.471
    solar_irradiance_w_m2_um = 2041.69
    [[bands]]
    number = 13
    fk1 = 10835.6
    fk2 = 1394.12
    bc1 = 0.07786
    bc2 = 0.99974
    [[bands]]
    number = 14
    """
    sensor = read_sensor(write(tmp_path, text))
    assert (sensor.name, sensor.platform) == ("west", "G17")
    assert isinstance(sensor.view, FixedGrid)
    assert sensor.view.x_rad[0] == pytest.approx(-0.069972)
    assert sensor.bands[1].wavelength_um == 0.471
    assert sensor.bands[1].coefficients()["kappa0"] == pytest.approx(np.pi / 2041.69)
    assert sensor.bands[13].coefficients()["fk2"] == 1394.12
    assert sensor.bands[14] == nominal_bands()[14]
    moved = read_sensor(tmp_path / "sensor.toml", subsatellite_longitude_deg=-75.2)
    assert isinstance(moved.view, FixedGrid)
    assert moved.view.subsatellite_longitude_deg == -75.2


ABI = 'kind = "abi"\nsector = "fulldisk"\nresolution_km = 10\n'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("kind = ", "is not valid TOML"),
        ("rows = 3", "has the kind None"),
        (CAMERA + "colums = 3", "unknown key, 'colums'.*'columns'"),
        (CAMERA.replace("altitude_m = 500e3", ""), "has no altitude_m"),
        (CAMERA.replace("= 30", "= 30.5"), "rows = 30.5: make it a whole number"),
        (CAMERA.replace("= 25", '= "north"'), "'north': make it a finite number"),
        (CAMERA.replace("= 25", "= nan"), "latitude_deg = nan: make it a finite"),
        # no float of 32 bits, and none at all
        (CAMERA.replace("= 30", "= 1e308", 1), "make it a"),
        (CAMERA.replace("= 25", f"= {10**400}"), "a finite number, within 1e30"),
        (CAMERA.replace("= 25", "= 95"), "latitude_deg of a camera must lie within"),
        (CAMERA + "target_latitude_deg = 3", "azimuth_deg"),
        (ABI.replace("10", "3"), "no grid of 3 km"),
        (ABI.replace("fulldisk", "fuldisk"), "sector = 'fuldisk': make it one of"),
        (ABI + "latitude_deg = 3", "only a mesoscale sector has"),
        (ABI.replace("fulldisk", "meso"), "sector without a place"),
        (
            ABI.replace("fulldisk", "meso") + "latitude_deg = 3\nlongitude_deg = 90",
            "cannot be seen",
        ),
        (ABI + "subsatellite_longitude_deg = 1e3", "must lie within"),
        (ABI + "bands = 3", "bands = 3: make it a list"),
        (ABI + "bands = []", "gives no bands"),
        (ABI + "bands = [17]", "the number 17: make it one from 1 to 16"),
        (ABI + "bands = [true]", "the number True"),
        (ABI + "bands = [2, 2]", "gives band 2 twice"),
        (ABI + "[[bands]]\nnumber = 2\nfk1 = 3", "band 2, has an unknown key, 'fk1'"),
        (ABI + "[[bands]]\nnumber = 13\nfk1 = 3", "only some of fk1, fk2, bc1, bc2"),
        (
            ABI + "[[bands]]\nnumber = 14\nfk1 = 8510.22\nfk2 = 1286.67\n"
            "bc1 = 0.2\nbc2 = 0.999",
            "contradict each other",
        ),
        (ABI + "[[bands]]\nnumber = 2\nwavelength_um = 0", "not positive"),
        (
            ABI + "[[bands]]\nnumber = 14\nfk1 = 8510.22\nfk2 = -1\nbc1=0\nbc2=1",
            "not positive",
        ),
    ],
)
def test_files_that_are_refused_in_one_sentence(tmp_path, text, message):
    with pytest.raises(DataError, match=message) as caught:
        read_sensor(write(tmp_path, text))
    assert "sensor.toml" in str(caught.value)
    assert str(caught.value).endswith(".")


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("abi-fulldisk-3km", {}, "is not a sensor: the names are abi-"),
        ("abi-full-2km", {}, "is not a sensor"),
        ("nowhere.toml", {}, "nowhere.toml is not a file: give a sensor's TOML"),
        ("abi-meso-2km", {}, "sector without a place"),
        ("abi-conus-2km", {"centre": (1.0, 2.0)}, "only a mesoscale sector has"),
    ],
)
def test_names_and_options_that_are_refused(name, options, message):
    with pytest.raises(DataError, match=message):
        read_sensor(name, **options)


def test_a_camera_has_no_satellite(tmp_path):
    with pytest.raises(DataError, match="is a camera"):
        read_sensor(write(tmp_path, CAMERA), subsatellite_longitude_deg=-75.0)
