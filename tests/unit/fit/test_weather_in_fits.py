"""What a weather analysis does to the scene of a fit: it draws, warms and covers."""

from dataclasses import replace
from datetime import timedelta

import jax
import numpy as np
import pytest
from tests.generated import SCAN_START, write_grib
from tests.scenes import write_scene, write_weather
from tests.small_fits import (
    flecked,
    small_class,
    small_imagery,
    small_target,
)

from cloudjax import FractalCloud
from cloudjax_data import open_folder, read_weather
from cloudjax_fit.fit_inputs import read_analysis, read_inputs
from cloudjax_fit.objective import pose
from cloudjax_scenes import Analysis, SceneFromImagery


LATITUDE, LONGITUDE = np.arange(90.0, -91.0, -5.0), np.arange(0.0, 360.0, 5.0)
SPEED_M_S, HOURS = 40.0, 1.0


def _turning_air(folder, speed_m_s: float = SPEED_M_S) -> Analysis:
    """Air of 270 K that turns about the Earth's axis as a whole."""
    shape = LATITUDE.size, LONGITUDE.size
    eastward = speed_m_s * np.cos(np.radians(LATITUDE))[:, None]
    values = {"v": 0.0, "w": 0.0, "r": 60.0, "t": 270.0, "u": eastward}
    levels = {1000: 110.0, 700: 3000.0, 500: 5600.0, 300: 9200.0}
    fields = {
        (name, level): np.broadcast_to(value, shape)
        for level, height in levels.items()
        for name, value in (values | {"gh": height}).items()
    }
    file = write_grib(
        folder / "gfs.grib2",
        fields,
        latitude_deg=LATITUDE,
        longitude_deg=LONGITUDE,
        time=SCAN_START,
    )
    return Analysis(read_weather(file))


def _textures(imagery, analysis):
    """What the rays of a fit read of the texture."""
    known = {"low": small_class(hours=HOURS)}
    made_of = SceneFromImagery(imagery, analysis, known=known, steps=4)
    target = small_target(imagery, flecked())
    problem, _ = pose(target, made_of.build(), (), rays=100, seed=0)
    (sample,) = problem.view.samples
    return np.asarray(sample.fractal(np.array([1.0, 0.5]), 4))


def test_the_rays_of_a_fit_see_clouds_that_the_wind_has_drawn(tmp_path):
    """Solid rotation for an hour, 144 km: the clouds are those of air that stands still
    under a satellite as much further west. Tolerance: a sixth of a standard deviation,
    200 m of waves of 7.5 km, for the winds are given every 5 degrees."""
    altitude_m = float(small_class().conditions.sampling_altitude_m)
    moved_deg = np.degrees(SPEED_M_S * 3600 * HOURS / (6371e3 + altitude_m))
    drawn = _textures(small_imagery(), _turning_air(tmp_path))
    upwind = _textures(small_imagery(west_deg=moved_deg), None)
    still = _textures(small_imagery(), None)
    np.testing.assert_allclose(drawn, upwind, atol=1 / 6)
    assert np.abs(drawn - still).max() > 0.5


def test_the_air_of_a_fit_is_as_warm_as_the_analysis(tmp_path):
    analysis = _turning_air(tmp_path, 0.0)
    made_of = SceneFromImagery(small_imagery(), analysis, known={"low": small_class()})
    kelvin = made_of.build().temperature(np.array([1000.0, 5000.0]))
    np.testing.assert_allclose(kelvin, 270.0, atol=0.5)


def test_a_weather_mask_asks_the_conditions_of_the_classes(tmp_path):
    """Of two classes of other names, the one that wants warmer air is nowhere."""
    analysis = _turning_air(tmp_path)
    anywhere = replace(
        small_class().conditions,
        vertical_wind_min_pa_s=-np.inf,
        vertical_wind_max_pa_s=np.inf,
        temperature_min_k=0.0,
    )
    warm = replace(anywhere, temperature_min_k=300.0, temperature_width_k=1.0)
    known = {
        "cold": small_class("cold", conditions=anywhere),
        "warm": small_class("warm", conditions=warm),
    }
    imagery = small_imagery(names=("cold", "warm"))
    found = analysis.masked(imagery, known).fractions
    # Sundqvist: 1 - sqrt((1 - 0.6)/(1 - 0.3)), softened near saturation.
    assert found["cold"] == pytest.approx(1 - np.sqrt(0.4 / 0.7), abs=0.02)
    assert found["warm"] == pytest.approx(0.0, abs=1e-6)


@pytest.fixture(scope="module")
def windowed(tmp_path_factory):
    """A scene folder of one band with the weather of two times."""
    folder = write_scene(tmp_path_factory.mktemp("scene") / "scene", (13,))
    for name, hours in (("a", -2.0), ("b", 1.0)):
        file = write_weather(folder, SCAN_START + timedelta(hours=hours))
        file.rename(folder / f"{name}.grib2")
    return folder


def test_the_analysis_of_a_scene_is_the_nearest_in_time(windowed):
    folder = open_folder(windowed)
    analysis = read_analysis(folder, folder.read((13,)))
    assert analysis is not None
    late = analysis.cube.valid_time - SCAN_START
    assert abs(late - timedelta(hours=1)) < timedelta(minutes=1)


def test_a_scene_with_weather_is_drawn_and_warmed_by_it(windowed):
    drawn = _clouds(read_inputs(windowed).made_of.build())
    assert all(m is not None for cloud in drawn for m in cloud.displacements or [None])
    still = _clouds(read_inputs(windowed, ignore_weather=True).made_of.build())
    assert all(cloud.displacements is None for cloud in still)


def _clouds(scene) -> list[FractalCloud]:
    return [layer.cloud for layer in scene.layers]


def test_a_weather_mask_replaces_the_clouds_of_the_imagery(windowed):
    """60 % humidity everywhere: every class covers the same share of each cell."""
    seen = read_inputs(windowed).made_of.imagery.fractions
    asked = read_inputs(windowed, weather_mask=True).made_of.imagery.fractions
    assert list(asked) == list(seen)
    for name, fraction in asked.items():
        assert np.ptp(fraction) < 0.01
        assert np.ptp(seen[name]) > 0.1


def test_views_of_a_fit_hold_no_maps():
    """The view has read masks and winds: scenes of other weather compile nothing."""
    imagery = small_imagery()
    made_of = SceneFromImagery(imagery, known={"low": small_class()}, steps=4)
    target = small_target(imagery, flecked())
    problem, _ = pose(target, made_of.build(), (), rays=50, seed=0)
    (cloud,) = _clouds(problem.scene)
    assert cloud.mask is None
    assert not jax.tree.leaves(cloud.displacements)
