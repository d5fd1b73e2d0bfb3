"""A viewpoint that flies: where it is, where it looks, and what is refused."""

import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest

from cloudjax.geometry.geodesy import ecef, geodetic
from cloudjax_data import DataError
from cloudjax_scenes.x3d.box import UP, Box
from cloudjax_scenes.x3d.document import Level, Sky, document
from cloudjax_scenes.x3d.flight import Flight, read_flight
from cloudjax_scenes.x3d.meshes import Tiles, ground_mesh
from cloudjax_scenes.x3d.viewer import page


BOX = Box(20.0, 179.9, 50e3)
HEAD = "time,latitude,longitude,height_m\n"


def _read(folder, text: str) -> Flight:
    path = folder / "flight.csv"
    path.write_text(text, encoding="utf-8")
    return read_flight(path)


@pytest.fixture
def flight(tmp_path) -> Flight:
    """To the east across the date line, a halt, then north and upwards."""
    rows = (
        "0,20,179.8,1000\n200,20,-179.9,1000\n300,20,-179.9,1000\n500,20.2,180.1,9000"
    )
    return _read(tmp_path, HEAD + rows)


@pytest.fixture
def sky(flight) -> Sky:
    level = Level(Tiles(BOX, 1), {}, {}, 0.0)
    ground = ground_mesh(BOX, 2)
    return Sky(BOX, (UP,), (level,), ground, "ground.png", 4e3, {}, flight)


def _array(root: ET.Element, node: str, field: str, each: int) -> np.ndarray:
    element = root.find(f".//{node}")
    assert element is not None
    return np.array((element.get(field) or "").split(), float).reshape(-1, each)


def _turned(rotation: np.ndarray) -> np.ndarray:
    """Where a viewer looks: along -z, turned about an axis (Rodrigues)."""
    k, angle, v = rotation[:3], rotation[3], np.array([0, 0, -1.0])
    return (
        v * np.cos(angle)
        + np.cross(k, v) * np.sin(angle)
        + k * (k @ v) * (1 - np.cos(angle))
    )


def test_it_is_where_the_file_says_at_each_time(sky, flight):
    root = ET.fromstring(document(sky))
    key = _array(root, "PositionInterpolator", "key", 1)[:, 0]
    found = _array(root, "PositionInterpolator", "keyValue", 3)
    sensor = root.find(".//TimeSensor")
    assert sensor is not None
    assert float(sensor.get("cycleInterval") or 0) == 500
    expected = BOX.local_m(
        ecef(
            np.array([20, 20, 20, 20.2]),
            np.array([179.8, 180.1, 180.1, 180.1]),
            np.array([1e3, 1e3, 1e3, 9e3]),
        )
    )
    x, y, z = (np.interp([0, 0.4, 0.6, 1], key, part) for part in found.T)
    np.testing.assert_allclose(np.stack([x, -z, y], -1), expected, atol=0.2)


def test_it_goes_the_short_way_over_the_date_line(flight):
    assert np.abs(np.diff(flight.longitude_deg)).max() < 1


def test_long_legs_follow_the_earth(tmp_path):
    flight = _read(tmp_path, HEAD + "0,0,0,1000\n1,0,10,1000")
    height = geodetic(flight.at(np.linspace(0, 1, 997)))[2]
    # A straight leg would be 24 km lower in its middle.
    np.testing.assert_allclose(height, 1000, atol=10)


def test_it_looks_along_its_path_and_stands_still_as_before(sky, flight):
    root = ET.fromstring(document(sky))
    key = _array(root, "OrientationInterpolator", "key", 1)[:, 0]
    looks = np.stack(
        [_turned(r) for r in _array(root, "OrientationInterpolator", "keyValue", 4)]
    )
    path = flight.at(np.clip(key[:, None] + [-1e-6, 1e-6], 0, 1).reshape(-1))
    way = np.diff(path.reshape(-1, 2, 3), axis=1)[:, 0] @ BOX.axes.T
    way = way[:, [0, 2, 1]] * [1, 1, -1]
    far = np.linalg.norm(way, axis=-1)
    ahead = way / np.maximum(far, 1e-9)[:, None]
    moving = (far > 0) & (key > 0) & (key < 1)
    np.testing.assert_allclose(looks[moving], ahead[moving], atol=1e-3)
    halt = (key > 0.41) & (key < 0.59)
    before = looks[np.flatnonzero(halt)[0] - 1]
    np.testing.assert_allclose(looks[halt], [before] * halt.sum(), atol=1e-6)


def test_the_globe_has_the_same_flight(sky, flight):
    root = ET.fromstring(document(sky, geographic=True))
    values = _array(root, "GeoPositionInterpolator", "keyValue", 3)
    np.testing.assert_allclose(ecef(*values.T), flight.position_m, atol=0.2)
    # East and then north, level in the first leg: in the axes of the place itself.
    first, *_, last = (
        _turned(r) for r in _array(root, "OrientationInterpolator", "keyValue", 4)
    )
    np.testing.assert_allclose(first, [1, 0, 0], atol=2e-3)
    north, climbs = 0.2 * 110.7e3, 8e3
    expected = np.array([0, climbs, -north]) / np.hypot(north, climbs)
    np.testing.assert_allclose(last, expected, atol=5e-3)


@pytest.mark.parametrize("geographic", [False, True])
def test_documents_with_a_flight_are_valid(sky, shared_data, geographic):
    etree = pytest.importorskip("lxml.etree", reason="lxml is absent")
    schema = etree.XMLSchema(etree.parse(shared_data / "x3d_schema/x3d-4.0.xsd"))
    root = etree.fromstring(document(sky, geographic=geographic))
    schema.assertValid(root)
    named = set(root.xpath("//@DEF"))
    assert set(root.xpath("//ROUTE/@fromNode | //ROUTE/@toNode")) <= named
    flown = root.xpath("//ROUTE[@toNode='flier']/@toField")
    assert sorted(flown) == ["set_orientation", "set_position"]


def test_the_page_keeps_the_flight_and_not_the_script(sky):
    text = page(replace(sky), {"ground.png": b""}, "title")
    assert "<Script" not in text
    assert text.count("<ROUTE") == 4
    assert "bindTime" not in text


def test_times_may_be_of_utc(tmp_path):
    rows = "2026-05-01T18:00:00Z,20,30,9\n2026-05-01T20:01:00+02:00,20,30.01,9"
    assert _read(tmp_path, HEAD + rows).seconds[-1] == 60


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "has no column time, latitude, longitude, height_m"),
        ("time,latitude,longitude\n0,1,2\n", "has no column height_m"),
        (HEAD, "has 0 rows"),
        (HEAD + "0,1,2,3", "has 1 rows"),
        (HEAD + "0,1,2,3\n0,1,3,3", "have to increase"),
        (HEAD + "5,1,2,3\n1,1,3,3", "goes from 5 to 1"),
        (HEAD + "0,1,2,3\n1,nan,3,3", "latitude = 'nan'"),
        (HEAD + "0,1,2,3\n1,1,3", "height_m = None"),
        (HEAD + "nan,1,2,3\n1,1,3,3", "a time that is no number"),
        (HEAD + "noon,1,2,3\n1,1,3,3", "the time 'noon'"),
        (HEAD + "0,91,2,3\n1,1,3,3", "latitude = 91"),
        (HEAD + "0,1,2,3\n1,1,3,4e6", "height_m = 4e+06"),
        (HEAD + "0,1,2,3\n1,1,2,3", "goes nowhere"),
        (HEAD + "0,1,2,3\n1,1,90,3", "leaps by"),
    ],
)
def test_files_that_are_no_flight_are_refused(tmp_path, text, said):
    with pytest.raises(DataError, match="flight") as caught:
        _read(tmp_path, text)
    assert said in str(caught.value)


def test_a_flight_elsewhere_is_refused(flight):
    flight.require_near(BOX)
    with pytest.raises(DataError, match=r"flight\.csv stays"):
        flight.require_near(Box(50.0, 0.0, 50e3))
