"""Clouds between analyses: carried by the wind, then blended; textures are renewed."""

import dataclasses
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
import pytest

from cloudjax import CoverMask, FractalCloud, cloud_classes, nominal_bands
from cloudjax.geometry.geodesy import up
from cloudjax_data import WeatherSeries, read_weather
from cloudjax_scenes.sensor_image import render_sensor
from cloudjax_scenes.sensors import read_sensor
from cloudjax_scenes.weather_decision import AllEvidence, Table1
from cloudjax_scenes.weather_scene import World
from tests.generated_grib import write_grib


TIME = datetime(2019, 10, 27, 18, tzinfo=UTC)
HOURS = 6
LEVELS = {1000: 110.0, 850: 1500.0, 700: 3000.0, 500: 5600.0, 300: 9200.0, 100: 16500.0}
LATITUDE, LONGITUDE = np.arange(90.0, -91.0, -5.0), np.arange(0.0, 360.0, 5.0)
STRATUS = cloud_classes()["low_stratus"]
RADIUS_M = 6371e3 + float(STRATUS.conditions.sampling_altitude_m)
# Air that turns by 20 degrees between two analyses.
TURN_DEG = 20.0
SPEED_M_S = np.radians(TURN_DEG) * RADIUS_M / (3600 * HOURS)
BAND = nominal_bands()[2]


def write(path, turned_deg, time, speed_m_s=SPEED_M_S, driest=40.0):
    """Moist air at every 60th meridian, turned eastward."""
    φ, λ = np.radians(np.meshgrid(LATITUDE, LONGITUDE, indexing="ij"))
    moist = np.exp(8 * (np.cos(6 * (λ - np.radians(turned_deg))) - 1)) * np.cos(φ)
    fields = {}
    for level, height in LEVELS.items():
        values = {
            "gh": height,
            "t": 300 - 7e-3 * height,
            "r": driest + (95 - driest) * moist,
        }
        values |= {"w": -0.3, "u": speed_m_s * np.cos(φ), "v": 0.0}
        fields |= {
            (name, level): np.broadcast_to(np.asarray(v, float), φ.shape)
            for name, v in values.items()
        }
    axes: dict[str, Any] = {"latitude_deg": LATITUDE, "longitude_deg": LONGITUDE}
    return read_weather(write_grib(path, fields, time=time, **axes))


@pytest.fixture(scope="module")
def series(tmp_path_factory):
    folder = tmp_path_factory.mktemp("motion")
    later = TIME + timedelta(hours=HOURS)
    cubes = write(folder / "a", 0.0, TIME), write(folder / "b", TURN_DEG, later)
    return WeatherSeries.of(cubes)


def world(series, decision, **changes) -> World:
    return World(series, {"a": dataclasses.replace(STRATUS, **changes)}, decision)


def cloud_of(made: World, time, winds=None) -> FractalCloud:
    (layer,) = made.scene([BAND], time, winds).layers
    assert isinstance(layer.cloud, FractalCloud)
    return layer.cloud


def cover(made: World, time, turned_deg=0.0):
    """The cover, or the probit of it, at places of the middle latitudes."""
    mask = cloud_of(made, time).mask
    assert mask is not None
    φ, λ = np.meshgrid(np.arange(-50.0, 51, 5), np.arange(-180.0, 180, 1.0))
    where = λ - turned_deg
    return mask.cover(φ, where) if isinstance(mask, CoverMask) else mask(φ, where)


def half(hours=HOURS):
    return TIME + timedelta(hours=hours / 2)


@pytest.mark.parametrize("decision", [AllEvidence(), Table1()])
def test_halfway_between_two_analyses_there_is_one_cloud(series, decision):
    """Not two pale ones: it is the first moved half the way."""
    made = world(series, decision)
    first = cover(made, TIME)
    found, moved = cover(made, half()), cover(made, TIME, TURN_DEG / 2)
    second = cover(made, TIME + timedelta(hours=HOURS))
    blend = (first + second) / 2

    def likeness(one):
        return np.corrcoef(found.ravel(), one.ravel())[0, 1]

    assert likeness(moved) > 0.999
    assert likeness(blend) < 0.5
    assert found.std() == pytest.approx(first.std(), rel=0.03)
    if isinstance(decision, AllEvidence):
        assert found.mean() == pytest.approx(first.mean(), rel=0.03)


def test_beyond_the_last_analysis_its_clouds_move_on(series):
    made = world(series, AllEvidence())
    later = TIME + timedelta(hours=HOURS * 1.5)
    last = cover(made, TIME + timedelta(hours=HOURS), TURN_DEG / 2)
    np.testing.assert_allclose(cover(made, later), last, atol=0.01)


def test_covers_of_still_air_are_linear_in_time(tmp_path):
    later = TIME + timedelta(hours=HOURS)
    cubes = [
        write(tmp_path / "a", 0.0, TIME, 0.0),
        write(tmp_path / "b", 30.0, later, 0.0),
    ]
    made = world(WeatherSeries.of(cubes), AllEvidence())
    expected = (3 * cover(made, TIME) + cover(made, later)) / 4
    found = cover(made, TIME + timedelta(hours=HOURS / 4))
    np.testing.assert_allclose(found, expected, atol=1e-5)


def drifts(cloud: FractalCloud):
    """Of each ladder, at some places."""
    places = up(np.array([-50.0, 0.0, 35.0]), np.array([-120.0, 10.0, 179.0]))
    maps = [m for m in cloud.displacements or () if m is not None]
    return [np.asarray(one.displacement_of(places)) for one in maps]


def test_a_film_begins_with_the_still(series):
    made = world(series, AllEvidence())
    still = cloud_of(made, TIME)
    ((_, winds), _) = made.frames(TIME, 2, 30.0)
    first = cloud_of(made, TIME, winds)
    ladders = len(still.ladders)
    assert len(first.ladders) == 2 * ladders
    weights = np.asarray(first.function.weights)
    np.testing.assert_allclose(weights[:ladders], still.function.weights)
    assert not weights[ladders:].any()
    np.testing.assert_allclose(drifts(first)[:ladders], drifts(still), atol=1e-7)


def test_textures_are_renewed_unseen_and_vary_as_much_as_ever(series):
    made = world(series, AllEvidence())
    still = cloud_of(made, TIME).function.weights
    before, renewed = None, 0
    for _, winds in made.frames(TIME, 12, 60.0):
        cloud = cloud_of(made, TIME, winds)
        weights = np.asarray(cloud.function.weights).reshape(2, -1)
        np.testing.assert_allclose((weights**2).sum(0), still**2, rtol=1e-5)
        now = np.linalg.norm(drifts(cloud), axis=-1).max(-1).reshape(2, -1)
        if before is not None:
            anew = np.abs(now - before[0]) > 0.2
            # On either side of the moment they are hardly seen.
            seen = np.maximum(weights, before[1]) / np.asarray(still)
            assert (seen[anew] < 0.75).all()
            renewed += anew.sum()
        before = now, weights
    assert renewed >= len(still)


def test_maps_that_are_carried_on_are_as_fresh_ones(series):
    """Within a hundredth of the way."""
    made = world(series, AllEvidence())
    (texture, *_) = STRATUS.textures
    (*_, (time, winds)) = made.frames(TIME, 3, 30.0)
    carried = drifts(cloud_of(made, TIME, winds))[0]
    longer = dataclasses.replace(
        texture, displacement_hours=texture.displacement_hours + 1
    )
    aged = world(series, AllEvidence(), textures=(longer, *STRATUS.textures[1:]))
    exact = drifts(cloud_of(aged, time))[0]
    way = np.linalg.norm(exact, axis=-1)
    assert (np.linalg.norm(carried - exact, axis=-1) < 0.01 * way).all()


@pytest.mark.slow
def test_nothing_pops_in_a_film(tmp_path):
    """Where a generation begins anew, after 2 and 4 hours, and at an analysis, after 3,
    pixels change no more from frame to frame than elsewhere.
    """
    slow, later = SPEED_M_S / 10, TIME + timedelta(hours=HOURS)
    cubes = (
        write(tmp_path / "a", 0.0, TIME, slow, 91.0),
        write(tmp_path / "b", TURN_DEG / 10, later, slow, 91.0),
    )
    short = [dataclasses.replace(t, displacement_hours=1.0) for t in STRATUS.textures]
    made = world(WeatherSeries.of(cubes), AllEvidence(), textures=tuple(short))
    made = dataclasses.replace(made, steps=6)
    sensor = read_sensor("abi-meso-10km", centre=(5.0, -65.0))
    bands = sensor.choose((13,))
    images = np.array(
        [
            render_sensor(made, sensor, bands, time, winds).radiance[13]
            for time, winds in made.frames(TIME + timedelta(hours=3), 31, 10.0)
        ]
    )
    change = np.sqrt(np.nanmean(np.diff(images, axis=0) ** 2, axis=(1, 2)))
    assert change.max() < 1.15 * np.median(change)
    assert np.median(change) < 0.5 * np.nanstd(images)
