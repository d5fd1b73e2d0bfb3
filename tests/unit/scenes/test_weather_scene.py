"""A world of weather alone: masks, winds, temperatures and the ground below."""

import dataclasses
from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import Camera, FractalCloud, Shell, cloud_classes, nominal_bands
from cloudjax.geometry.geodesy import up
from cloudjax.march.radiances import see_clear
from cloudjax.march.view import look_around
from cloudjax_data import (
    DataError,
    WeatherSeries,
    earth_sun_distance_au,
    read_weather,
    sun_direction,
)
from cloudjax_scenes.ground_cover import SEA
from cloudjax_scenes.weather_decision import Table1
from cloudjax_scenes.weather_scene import World, steps_through
from tests.generated_grib import write_grib


TIME = datetime(2019, 10, 27, 18, tzinfo=UTC)
LEVELS = {1000: 110.0, 850: 1500.0, 700: 3000.0, 500: 5600.0, 300: 9200.0, 100: 16500.0}
LATITUDE, LONGITUDE = np.arange(90.0, -91.0, -10.0), np.arange(0.0, 360.0, 10.0)
SHAPE = LATITUDE.size, LONGITUDE.size
BANDS = nominal_bands()


def analysis(folder: Path, time: datetime = TIME, **given):
    """One air mass of 7 K/km, but for the fields that are given."""
    fields: dict[tuple[str, int], np.ndarray] = {}
    for level, height in LEVELS.items():
        usual: Mapping = {"gh": height, "t": 300 - 7e-3 * height, "r": 60.0, "w": 0.0}
        values = {**usual, "u": 0.0, "v": 0.0, **given}
        fields |= {
            (name, level): np.broadcast_to(np.asarray(value, float), SHAPE)
            for name, value in values.items()
        }
    file = folder / "gfs.grib2"
    write_grib(file, fields, latitude_deg=LATITUDE, longitude_deg=LONGITUDE, time=time)
    return read_weather(file)


def world(*cubes, **settings: Any) -> World:
    """Of one class of cloud if no others are given, for each takes its time."""
    settings.setdefault("classes", {"low_stratus": cloud_classes()["low_stratus"]})
    return World(WeatherSeries.of(cubes), **settings)


def west_wind(speed_m_s: float = 40.0) -> dict[str, Any]:
    """Air that turns about the Earth's axis as a whole."""
    return {"u": speed_m_s * np.cos(np.radians(LATITUDE))[:, None]}


def test_uniform_weather_has_uniform_masks(tmp_path):
    made = world(analysis(tmp_path), classes=cloud_classes(), decision=Table1())
    clouds = [layer.cloud for layer in made.scene([BANDS[2]], TIME).layers]
    masks = [cloud.mask for cloud in clouds if isinstance(cloud, FractalCloud)]
    φ, λ = np.array([-70.0, -3.0, 0.0, 45.0]), np.array([179.9, -180.0, 0.3, 77.0])
    for one, mask in zip(made.classes.values(), masks, strict=True):
        fraction = made.fractions[0][one.name]
        assert np.ptp(fraction) < 1e-6
        assert mask is not None
        from_above = mask(φ, λ)
        assert np.ptp(from_above) < 1e-5
        assert 0 < fraction.mean() < 0.5


def test_masks_follow_the_sign_of_the_vertical_wind(tmp_path):
    # Pa/s: air that rises loses pressure.
    cube = analysis(tmp_path, w=-0.5)
    given = {"classes": cloud_classes(), "decision": Table1()}
    up_ward, down_ward = (
        world(cube, omega_sign=sign, **given).fractions[0]["low_cumulus"].mean()
        for sign in (-1.0, 1.0)
    )
    assert up_ward > 0.2
    assert down_ward < 0.2 * up_ward


def test_a_mask_is_drawn_from_where_the_air_came(tmp_path):
    """Solid rotation by 40 m/s for 10 h moves all air by one longitude."""
    east = np.radians(LONGITUDE)[None, :]
    moist = analysis(tmp_path, r=60 + 20 * np.cos(east), **west_wind())
    classes = cloud_classes()
    still, drawn = (
        world(moist, classes={"a": one}, decision=Table1())
        for one in (
            classes["low_stratus"],
            _masks_move(classes["low_stratus"], 10.0),
        )
    )
    altitude = float(classes["low_stratus"].conditions.sampling_altitude_m)
    moved_deg = np.degrees(40.0 * 36000 / (6371e3 + altitude))
    φ, λ = np.array([-60.0, 0.0, 15.0, 60.0]), np.array([-170.0, 5.0, 90.0, 179.0])
    expected = _mask(still)(φ, λ - moved_deg)
    assert np.abs(expected - _mask(still)(φ, λ)).max() > 0.05
    np.testing.assert_allclose(_mask(drawn)(φ, λ), expected, atol=2e-3)


def _masks_move(one, hours: float):
    return dataclasses.replace(one, mask_displacement_hours=hours)


def _mask(made: World):
    cloud = made.scene([BANDS[2]], TIME).layers[0].cloud
    assert isinstance(cloud, FractalCloud)
    assert cloud.mask is not None
    return cloud.mask


def test_temperatures_are_linear_between_levels_and_held_beyond(tmp_path):
    made = world(analysis(tmp_path))
    φ, λ = np.array([0.0, 41.0, -88.0, 10.0]), np.array([0.0, -179.0, 33.0, 5.0])
    z = np.array([1000.0, 3333.0, 12_345.0, 40_000.0])
    expected = 300 - 7e-3 * np.minimum(z, 15_500.0)
    np.testing.assert_allclose(made.temperature.at(φ, λ, z), expected, atol=0.01)
    # There is nothing below the lowest level, 110 m: the first one above serves.
    below = made.temperature.at(φ[:1], λ[:1], np.array([-100.0]))
    assert below == pytest.approx(300 - 7e-3 * 500, abs=0.01)


def clear(scene, rays):
    """What is seen without cloud."""
    return see_clear(scene, look_around(scene, rays, sun_direction(TIME)))[0]


def seen_from(latitude_deg: float, longitude_deg: float):
    place = latitude_deg, longitude_deg, 500e3
    return Camera(*place, 0.0, -90.0, 1.0, 1, 1).rays()


def test_the_ground_is_dark_by_night_and_brighter_on_land(tmp_path):
    made = world(analysis(tmp_path), air=False)
    scene = made.scene([BANDS[3], BANDS[13]], TIME)
    assert scene.reflective is not None
    places = {"land": (-5.0, -65.0), "sea": (0.0, -140.0), "night": (1.0, 114.0)}
    seen = {name: clear(scene, seen_from(*place)) for name, place in places.items()}
    per_radiance = float(scene.reflective.reflectance_per_radiance[0])
    factor = {
        name: float(np.asarray(one.reflective)[0, 0]) * per_radiance
        for name, one in seen.items()
    }
    φ, λ = np.array([[0.0], [-140.0]])
    sun = float((up(φ, λ) * sun_direction(TIME)).sum())
    assert factor["sea"] == pytest.approx(SEA[2] * sun, rel=1e-3)
    assert factor["land"] > 5 * factor["sea"]
    assert factor["night"] == 0
    assert scene.emissive is not None
    for one in seen.values():
        assert one.emissive is not None
        kelvin = scene.emissive.brightness_temperature_k(one.emissive)
        # 110 m at the lapse rate of the surface above 0 m.
        assert float(kelvin[0, 0]) == pytest.approx(300 - 0.77 + 0.715, abs=0.05)


def test_the_ground_warms_from_one_analysis_to_the_next(tmp_path):
    """Lowest air of 290 and 302 K, six hours apart; nothing is said of before."""
    (tmp_path / "later").mkdir()
    six_hours = timedelta(hours=6)
    made = world(
        analysis(tmp_path, t=290.0),
        analysis(tmp_path / "later", TIME + six_hours, t=302.0),
    )
    at = np.array([23.0]), np.array([10.0])
    for share, warmer_k in ((-1.0, 0.0), (0.0, 0.0), (0.25, 3.0), (1.0, 12.0)):
        found = made.surface(TIME + share * six_hours).cover(*at).temperature_k
        assert found == pytest.approx(290 + 0.715 + warmer_k, abs=0.01)


def test_there_is_nothing_where_a_ray_misses_the_earth(tmp_path):
    made = world(analysis(tmp_path))
    scene = made.scene([BANDS[2], BANDS[13]], TIME)
    away = Camera(0.0, 0.0, 500e3, 0.0, 45.0, 1.0, 1, 1).rays()
    seen = clear(scene, away)
    assert not np.asarray(seen.reflective).any()
    assert not np.asarray(seen.emissive).any()


def test_optics_are_those_of_the_radius_of_the_class(tmp_path):
    one = cloud_classes()["low_stratus"]
    coarse = dataclasses.replace(one, effective_radius_um=30.0)
    made = world(analysis(tmp_path), classes={"a": one, "b": coarse})
    fine, big = made.scene([BANDS[5], BANDS[13]], TIME).layers
    # Larger droplets absorb more of 1.6 µm.
    small, large = (float(a.optics.scatterers.co_albedo[0]) for a in (fine, big))
    assert large > 2 * small


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"classes": {}}, "no class of cloud"),
        ({"seed": -1}, "seed = -1"),
        ({"steps": 0}, "steps = 0"),
        ({"light": "dim"}, "no light 'dim'"),
    ],
)
def test_a_world_that_cannot_be_is_refused(tmp_path, settings, words):
    with pytest.raises(DataError, match=words):
        world(analysis(tmp_path), **settings)


def test_band_7_reflects_and_emits_by_day_and_emits_by_night(tmp_path):
    """Sea of albedo 0.02 and emissivity 0.98 under a high sun: one row, the sum."""
    made = world(analysis(tmp_path), air=False)
    rays = seen_from(0.0, -140.0)
    seen = {}
    for day in (True, False):
        scene = made.scene([BANDS[7], BANDS[13]], TIME, day=day)
        assert scene.bands == (7, 13)
        assert (scene.reflective is not None) == day
        seen[day] = np.asarray(scene.total(clear(scene, rays)))[:, 0]
    assert scene.emissive is not None
    black = scene.emissive.planck(jnp.asarray([300 - 0.77 + 0.715]))[:, 0]
    np.testing.assert_allclose(seen[False], black * np.array([0.98, 1.0]), rtol=3e-3)
    sun = float((up(*np.array([[0.0], [-140.0]])) * sun_direction(TIME)).sum())
    # 14.655 mW m⁻² (cm⁻¹)⁻¹ of sunlight at 1 astronomical unit, over π.
    reflected = 0.02 * sun * 14.655 / np.pi / earth_sun_distance_au(TIME) ** 2
    np.testing.assert_allclose(seen[True] - seen[False], [reflected, 0], rtol=1e-4)


@pytest.mark.parametrize(
    ("depth_m", "steps", "found"),
    [(14e3, 24, 24), (3e3, 24, 12), (1e3, 24, 8), (1e3, 12, 6), (1e3, 2, 2)],
)
def test_thin_shells_have_fewer_steps(depth_m, steps, found):
    assert steps_through(Shell(500.0, 500.0 + depth_m), steps) == found


def test_shadows_are_asked_in_steps_and_for_physical_light(tmp_path):
    cube = analysis(tmp_path)
    assert world(cube).scene([BANDS[2]], TIME).shadows is None
    shadows = world(cube, shadows=4).scene([BANDS[2]], TIME).shadows
    assert shadows is not None
    assert shadows.steps == 4
    for wrong in ({"shadows": -1}, {"shadows": 4, "light": "paper"}):
        with pytest.raises(DataError):
            world(cube, **wrong)
