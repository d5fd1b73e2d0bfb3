"""What each class of a scene has of its own, and what bands are told of the sun."""

from dataclasses import replace

import numpy as np
import pytest

from cloudjax import nominal_bands
from cloudjax.clouds.ladder import frames
from cloudjax_data import WeatherSeries, open_folder, read_weather
from cloudjax_scenes import SceneFromImagery
from cloudjax_scenes.imagery_reduction import reduce_scene
from cloudjax_scenes.weather_scene import World
from tests.generated import SCAN_START, default_calibration, window, write_abi_l1b
from tests.scenes import write_weather
from tests.small_fits import RULE, small_class, small_imagery


BANDS = nominal_bands()


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    file = write_weather(tmp_path_factory.mktemp("weather"), SCAN_START)
    known = {"a": small_class("a"), "b": small_class("b")}
    return World(WeatherSeries.of([read_weather(file)]), known)


def _textures(scene):
    """How the longest rung of each class is turned and shifted."""
    made = [frames(layer.cloud.ladders, layer.cloud.seed) for layer in scene.layers]
    return [
        np.append(turned[0] / np.abs(turned[0]).max(), shifts[0])
        for turned, shifts in made
    ]


def test_no_two_classes_have_one_texture(world):
    """Not in weather nor in imagery; another seed changes all of them."""
    known = {"a": small_class("a"), "b": small_class("b")}
    imagery = small_imagery(names=("a", "b"))
    made_of = SceneFromImagery(imagery, known=known)
    for some in (world, made_of):
        build = some.build if some is made_of else _of_weather(some)
        again = replace(some, seed=1)
        other = again.build if some is made_of else _of_weather(again)
        read = [*_textures(build()), *_textures(other())]
        apart = [np.abs(np.corrcoef(read)[i, j]) for i in range(4) for j in range(i)]
        assert max(apart) < 0.9


def _of_weather(world):
    return lambda: world.scene([BANDS[2]], SCAN_START)


def test_extinction_is_the_light_s_share_of_the_physical_one(world):
    """(1 - 0.85)/2 in the paper's light, all in the physical one; a cloud absorbs as
    much heat in both."""
    one = small_class()
    for light, share in (("paper", 0.075), ("physical", 1.0)):
        ((a, _),) = [
            replace(world, light=light).scene([BANDS[2], BANDS[13]], SCAN_START).layers
        ]
        extinction = float(a.extinction_per_m)
        assert extinction == pytest.approx(share * one.extinction_per_m, rel=1e-6)
        assert float(a.absorptions_per_m[0]) == pytest.approx(
            one.extinction_per_m * one.absorption_ratio, rel=1e-6
        )


def test_reflectance_of_a_scene_is_that_of_its_file(tmp_path):
    """A clear pixel of reflectance 0.2 in the file has it in the imagery's band, and in
    the scene: the irradiance is brought to one astronomical unit and back."""
    shape = (16, 16)
    image = np.full(shape, 0.2)
    image[:4] = 0.6
    for distance in (0.985, 1.015):
        folder = tmp_path / f"{distance}"
        folder.mkdir()
        calibration = default_calibration(1, distance)
        write_abi_l1b(
            folder,
            band=1,
            radiance=calibration.radiance(image),
            grid=window(shape),
            earth_sun_distance_au=distance,
        )
        scene = open_folder(folder).read((1,))
        rule = replace(RULE, cold_band=None, bright_reflectance=0.4)
        imagery = reduce_scene(scene, rule=rule).imagery
        clear = imagery.background.radiance[1].min()
        assert clear * imagery.coefficients(1)["kappa0"] == pytest.approx(0.2, rel=0.01)
        reflective = SceneFromImagery(imagery).build().reflective
        assert reflective is not None
        factor = float(reflective.reflectance_per_radiance[0])
        assert clear * factor == pytest.approx(0.2, rel=0.01)
