"""The perspective camera: where its axis and its corners look."""

import numpy as np
import pytest

from cloudjax import Camera
from cloudjax.geometry.geodesy import ecef, geodetic, up


def camera(**changes) -> Camera:
    values = {
        "latitude_deg": 35.0,
        "longitude_deg": -110.0,
        "altitude_m": 500e3,
        "azimuth_deg": 0.0,
        "elevation_deg": -90.0,
        "field_of_view_deg": 4.0,
        "rows": 3,
        "columns": 5,
    }
    return Camera(**(values | changes))


def place(latitude_deg, longitude_deg, altitude_m):
    φ, λ, z = np.array([[latitude_deg], [longitude_deg], [altitude_m]], float)
    return ecef(φ, λ, z)[0]


def local(camera: Camera, direction) -> np.ndarray:
    """Components to the east, the north and up."""
    λ = np.radians(camera.longitude_deg)
    east = np.array([-np.sin(λ), np.cos(λ), 0])
    vertical = up(np.array(camera.latitude_deg), np.array(camera.longitude_deg))
    return np.stack([east, np.cross(vertical, east), vertical]) @ direction


def test_rays_start_at_the_camera_and_run_row_by_row():
    rays = camera().rays()
    assert camera().shape == (3, 5)
    assert len(rays) == 15
    assert rays.direction.dtype == rays.origin_m.dtype == np.float64
    np.testing.assert_allclose(np.linalg.norm(rays.direction, axis=-1), 1, rtol=1e-15)
    latitude, longitude, altitude = geodetic(np.array(rays.origin_m))
    np.testing.assert_allclose(latitude, 35.0, atol=1e-10)
    np.testing.assert_allclose(longitude, -110.0, atol=1e-10)
    np.testing.assert_allclose(altitude, 500e3, atol=1e-6)


def test_from_above_north_is_up_and_east_is_right():
    ground, hit = camera().rays().ground()
    assert hit.all()
    latitude = ground.latitude_deg.reshape(3, 5)
    longitude = ground.longitude_deg.reshape(3, 5)
    assert latitude[1, 2] == pytest.approx(35.0, abs=1e-9)
    assert longitude[1, 2] == pytest.approx(-110.0, abs=1e-9)
    assert np.all(np.diff(latitude[:, 2]) < 0)
    assert np.all(np.diff(longitude[1]) > 0)


@pytest.mark.parametrize("azimuth_deg", [-130.0, 0.0, 40.0, 200.0])
@pytest.mark.parametrize("elevation_deg", [-90.0, -25.0, 0.0, 30.0, 90.0])
def test_the_axis_looks_where_it_is_told(azimuth_deg, elevation_deg):
    c = camera(azimuth_deg=azimuth_deg, elevation_deg=elevation_deg, altitude_m=3e3)
    α, ε = np.radians([azimuth_deg, elevation_deg])
    axis, right, top = (local(c, vector) for vector in c.axes)
    expected = [np.cos(ε) * np.sin(α), np.cos(ε) * np.cos(α), np.sin(ε)]
    np.testing.assert_allclose(axis, expected, atol=1e-12)
    np.testing.assert_allclose(local(c, c.rays().direction[7]), expected, atol=1e-12)
    # The horizon is level, its right a quarter turn clockwise from ahead.
    np.testing.assert_allclose(right, [np.cos(α), -np.sin(α), 0], atol=1e-12)
    np.testing.assert_allclose(np.cross(right, axis), top, atol=1e-12)
    assert top[2] >= -1e-12


def test_a_roll_to_the_right_lowers_the_right_wing():
    c = camera(elevation_deg=0.0, azimuth_deg=90.0, roll_deg=30.0, altitude_m=3e3)
    _, right, top = (local(c, vector) for vector in c.axes)
    np.testing.assert_allclose(right, [0, -np.sqrt(0.75), -0.5], atol=1e-12)
    np.testing.assert_allclose(top, [0, -0.5, np.sqrt(0.75)], atol=1e-12)


def test_the_field_of_view_ends_at_the_edges_of_the_pixels():
    c = camera(field_of_view_deg=60.0, rows=4, columns=4)
    rays = c.rays()
    axis, right, _ = c.axes
    tangent = (rays.direction @ right / (rays.direction @ axis)).reshape(4, 4)
    half = np.tan(np.radians(30))
    np.testing.assert_allclose(tangent[0], half * np.array([-0.75, -0.25, 0.25, 0.75]))
    assert rays.pixel_rad == pytest.approx(2 * np.arctan(half / 4))
    narrow = camera(field_of_view_deg=1e-3, columns=100, rows=1).rays()
    between = np.linalg.norm(np.diff(narrow.direction, axis=0), axis=-1)
    np.testing.assert_allclose(between, narrow.pixel_rad, rtol=1e-6)


@pytest.mark.parametrize(
    ("target", "altitude_m"),
    [((36.0, -109.0), 500e3), ((34.9, -110.0), 10e3), ((35.01, -110.02), 0.0)],
)
@pytest.mark.parametrize("height_m", [0.0, 4e3])
def test_a_camera_looks_at_its_target(target, altitude_m, height_m):
    c = Camera.looking_at(
        35.0,
        -110.0,
        altitude_m,
        target_latitude_deg=target[0],
        target_longitude_deg=target[1],
        target_altitude_m=height_m,
        field_of_view_deg=10.0,
        rows=1,
        columns=1,
    )
    line = place(target[0], target[1], height_m) - c.position_m
    seen = c.rays().direction[0]
    np.testing.assert_allclose(seen, line / np.linalg.norm(line), atol=1e-12)


@pytest.mark.parametrize(("altitude_m", "expected"), [(9e3, -90.0), (0.0, 90.0)])
def test_straight_down_and_up_have_azimuth_zero(altitude_m, expected):
    c = Camera.looking_at(
        35.0,
        -110.0,
        altitude_m,
        target_latitude_deg=35.0,
        target_longitude_deg=-110.0,
        target_altitude_m=4e3,
        field_of_view_deg=10.0,
        rows=1,
        columns=1,
    )
    assert c.elevation_deg == pytest.approx(expected)
    assert c.azimuth_deg == 0.0


@pytest.mark.parametrize("latitude_deg", [90.0, -90.0])
def test_a_camera_at_a_pole_is_finite(latitude_deg):
    rays = camera(latitude_deg=latitude_deg).rays()
    assert np.isfinite(rays.direction).all()
    ground, hit = rays.ground()
    assert hit.all()
    assert ground.latitude_deg[7] == pytest.approx(latitude_deg, abs=1e-6)


def test_tiles_of_rays_are_those_of_the_whole():
    whole, tile = camera().rays(), camera().rays(np.array([14, 2]))
    np.testing.assert_array_equal(tile.direction, whole.direction[[14, 2]])
    np.testing.assert_array_equal(tile.origin_m, whole.origin_m[[14, 2]])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"latitude_deg": 91.0}, "latitude_deg of a camera must lie within -90 and 90"),
        ({"elevation_deg": float("nan")}, "elevation_deg of a camera must lie"),
        ({"altitude_m": -1e4}, "altitude_m of a camera must lie"),
        ({"field_of_view_deg": 180.0}, "must lie between 0 and 180"),
        ({"rows": 0}, "sees nothing"),
    ],
)
def test_cameras_that_cannot_be_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        camera(**changes)


def test_a_camera_cannot_look_at_itself():
    with pytest.raises(ValueError, match="cannot look at its own place"):
        Camera.looking_at(
            0.0,
            0.0,
            10.0,
            target_latitude_deg=0.0,
            target_longitude_deg=0.0,
            target_altitude_m=10.0,
            field_of_view_deg=1.0,
            rows=1,
            columns=1,
        )
