"""Optical depths of images are physical and vertical in every light."""

import numpy as np
import pytest

from cloudjax import nominal_bands
from cloudjax_data import WeatherSeries, read_weather
from cloudjax_scenes import LIGHTS, SceneFromImagery, simulate_image
from cloudjax_scenes.cloud_rule import CloudRule
from cloudjax_scenes.sensor_image import render_sensor
from cloudjax_scenes.sensors import Sensor
from cloudjax_scenes.weather_decision import Table1
from cloudjax_scenes.weather_scene import World
from tests.generated import SCAN_START, window
from tests.scenes import write_weather
from tests.small_fits import full_slab, small_imagery


DEPTH = 5.0


@pytest.mark.parametrize("light", LIGHTS.values(), ids=list(LIGHTS))
def test_a_full_slab_over_imagery_is_as_deep_as_its_extinction_times_its_height(light):
    """Tolerance: 4 %, for steps of 50 m meet edges of a slab of 1.1 km."""
    imagery = small_imagery(bands=(1,), rule=CloudRule(1, 0.25, None, -np.inf))
    made_of = SceneFromImagery(
        imagery, None, light, {"low": full_slab(DEPTH)}, steps=44
    )
    image = simulate_image(made_of.build(), made_of)
    np.testing.assert_allclose(image.depths[0], DEPTH, rtol=0.04)
    np.testing.assert_allclose(image.optical_depth, DEPTH, rtol=0.04)


@pytest.fixture(scope="module")
def series(tmp_path_factory):
    file = write_weather(tmp_path_factory.mktemp("weather"), SCAN_START)
    return WeatherSeries.of([read_weather(file)])


@pytest.mark.parametrize("light", LIGHTS)
def test_a_full_slab_over_weather_is_as_deep_too(series, light):
    """Tolerance: 4 %."""
    known = {"low": full_slab(DEPTH)}
    world = World(series, known, Table1(), steps=44, light=light, air=False)
    band = nominal_bands()[2]
    sensor = Sensor("test", "ABI", window((6, 6)), {2: band})
    image = render_sensor(world, sensor, [band], SCAN_START)
    np.testing.assert_allclose(image.cloud_optical_depth, DEPTH, rtol=0.04)
    assert (image.cloud_class == 1).all()
    assert (abs(image.cloud_top_height_m - 1750) < 350).all()
