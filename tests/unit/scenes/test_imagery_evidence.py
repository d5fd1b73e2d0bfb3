"""What imagery tells of clouds from place to place, and which pixels are whose."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cloudjax import imagery_classes
from cloudjax_data import DataError
from cloudjax_data.calibration import EmissiveCalibration
from cloudjax_scenes.cells import Cells, places_at
from cloudjax_scenes.class_pixels import Shown, tell_classes
from cloudjax_scenes.imagery_evidence import (
    CELL_PIXELS,
    Seen,
    class_evidence,
    cloud_albedo,
)
from tests.generated import default_calibration, window


SHAPE = (160, 160)
GRID = window(SHAPE)
EVERY = np.ones(SHAPE, bool)
GROUND_K, CLOUD_K = 289.0, 270.0
NORTH = np.arange(SHAPE[0])[:, None] < SHAPE[0] // 2


def _shown(**changes) -> Shown:
    """Columns in turn: thick and cold, thin and cold, warm, thin and warm, clear."""
    turn = np.broadcast_to(np.arange(SHAPE[1]) % 5, SHAPE)
    cloud = turn < 3
    return Shown(
        **{
            "good": EVERY,
            "cloud": cloud,
            "thin": turn == 3,
            "reflectance": np.choose(turn, [0.6, 0.2, 0.5, 0.15, 0.05]),
            "window_k": np.choose(turn, [250.0, 260.0, 285.0, 288.0, 290.0]),
        }
        | changes
    )


def test_clouds_are_told_by_temperature_and_brightness():
    told = tell_classes(_shown(), imagery_classes())
    turn = np.broadcast_to(np.arange(SHAPE[1]) % 5, SHAPE)
    np.testing.assert_array_equal(told["thick_cold"].own, turn == 0)
    np.testing.assert_array_equal(told["cirrus"].own, turn == 1)
    # What is thin and warm is low cloud as well, and cold cloud hides what is below.
    np.testing.assert_array_equal(told["low_stratus"].own, (turn == 2) | (turn == 3))
    np.testing.assert_array_equal(told["low_stratus"].seen, turn > 1)
    assert told["cirrus"].seen.all()


def test_by_night_all_that_is_cold_is_taken_for_thick():
    told = tell_classes(_shown(reflectance=None), imagery_classes())
    assert list(told) == ["thick_cold", "low_stratus"]
    turn = np.broadcast_to(np.arange(SHAPE[1]) % 5, SHAPE)
    np.testing.assert_array_equal(told["thick_cold"].own, turn < 2)


def test_classes_that_take_no_pixel_are_an_error():
    classes = {"cirrus": imagery_classes()["cirrus"]}
    with pytest.raises(DataError, match="takes a cloud pixel"):
        tell_classes(_shown(window_k=None), classes)


def _window() -> EmissiveCalibration:
    calibration = default_calibration(13)
    assert isinstance(calibration, EmissiveCalibration)
    return calibration


def _radiance(kelvin):
    return _window().radiance(np.broadcast_to(kelvin, SHAPE))


def _told(seen: Seen, own=EVERY, depth_m=2650.0):
    """The cells, and what is told of a class that covers half of the sky."""
    cells = Cells.covering(GRID, EVERY, CELL_PIXELS)
    return cells, class_evidence(
        cells,
        places_at(GRID, 1000.0),
        own,
        np.full(SHAPE, 0.5),
        depth_m,
        seen,
        _window().brightness_temperature_k,
    )


def _evidence(albedo, kelvin: Any = CLOUD_K, own=EVERY):
    clear, black = _radiance(GROUND_K), _radiance(kelvin)
    seen = Seen.by_day(np.broadcast_to(albedo, SHAPE), black, clear)
    window = clear + seen.emissivity * (black - clear)
    return _told(replace(seen, window=window), own)


def _by_night(kelvin):
    """Opaque cloud of these temperatures, and what is told of it."""
    kelvin = np.broadcast_to(kelvin, SHAPE)
    seen = Seen.by_night(_radiance(kelvin), _radiance(GROUND_K), kelvin)
    return _told(seen, depth_m=9300.0)


def _halves(cells, field):
    """Means of a field over the middle of the northern and the southern half."""
    middle = (cells.latitude_deg[0] + cells.latitude_deg[-1]) / 2
    span = cells.latitude_deg[-1] - cells.latitude_deg[0]
    away = np.abs(cells.latitude_deg - middle)
    inside = (away > 0.15 * span) & (away < 0.35 * span)
    north = cells.latitude_deg > middle
    return field[inside & north].mean(), field[inside & ~north].mean()


def test_optical_depth_is_that_of_two_streams():
    """τ = 2/(1 - g) A/(1 - A): albedos of 0.5 and 0.2 are optical depths of 4 to 1."""
    cells, told = _evidence(np.where(NORTH, 0.5, 0.2))
    north, south = _halves(cells, told.nodes[..., 0])
    assert north - south == pytest.approx(np.log(4.0), rel=0.02)


def test_tops_are_where_the_air_is_as_cold():
    """6.5 K per kilometre, of thin cloud as of thick: 3.25 K are 500 m."""
    kelvin = np.where(NORTH, CLOUD_K, CLOUD_K + 3.25)
    for albedo in (0.7, 0.25):
        cells, told = _evidence(albedo, kelvin)
        north, south = _halves(cells, told.nodes[..., 1])
        assert north - south == pytest.approx(500.0, rel=0.03)
        mean = (288.15 - CLOUD_K - 3.25 / 2) / 0.0065
        assert told.top_m == pytest.approx(mean, rel=0.02)


def test_by_night_tops_are_told_by_temperatures_alone():
    """13 K are 2000 m of opaque cloud; depths are not told."""
    cells, told = _by_night(np.where(NORTH, 240.0, 253.0))
    north, south = _halves(cells, told.nodes[..., 1])
    assert north - south == pytest.approx(2000.0, rel=0.03)
    assert told.top_m == pytest.approx((288.15 - 246.5) / 0.0065, rel=0.02)
    assert np.abs(told.nodes[..., 0]).max() < 1e-9


def test_by_night_roughness_is_that_of_temperatures():
    noise = np.random.default_rng(0).standard_normal(SHAPE)
    cells, told = _by_night(250 + np.where(NORTH, 1.0, 0.5) * noise)
    north, south = _halves(cells, told.nodes[..., 2])
    assert north - south == pytest.approx(np.log(2.0), rel=0.1)


def test_roughness_is_that_of_increments():
    """Noise of twice the size is rougher by ln 2. Tolerance: 10 %, for albedos are not
    logits."""
    noise = np.random.default_rng(0).standard_normal(SHAPE)
    cells, told = _evidence(0.5 + np.where(NORTH, 0.04, 0.02) * noise)
    north, south = _halves(cells, told.nodes[..., 2])
    assert north - south == pytest.approx(np.log(2.0), rel=0.1)


def test_nothing_finer_than_a_cell_is_told():
    """Pixels are shuffled within blocks of a quarter of a cell's area: depth and top
    stay, within a twentieth of what they hold."""
    rng = np.random.default_rng(1)
    rows, columns = np.indices(SHAPE)
    large = 0.5 + 0.2 * np.sin(rows / 25) * np.cos(columns / 25)
    albedo = np.clip(large + 0.1 * rng.standard_normal(SHAPE), 0.05, 0.8)
    blocks = albedo.reshape(40, 4, 40, 4).swapaxes(1, 2).reshape(40, 40, 16)
    shuffled = rng.permuted(blocks, axis=-1).reshape(40, 40, 4, 4).swapaxes(1, 2)
    _, one = _evidence(albedo)
    _, other = _evidence(shuffled.reshape(SHAPE))
    apart = np.abs(one.nodes - other.nodes)[8:-8, 8:-8, :2].max((0, 1))
    held = one.nodes[..., :2].std((0, 1))
    assert apart[0] < 0.2 * held[0]
    assert np.abs(one.top_m - other.top_m) < 10.0


def test_what_goes_with_the_mask_is_left_to_the_mask():
    """A depth that is a function of the fraction alone is no evidence."""
    cells, _ = _evidence(0.5)
    rng = np.random.default_rng(2)
    field = rng.standard_normal((20, 20))
    from cloudjax_scenes.imagery_evidence import _beside_the_mask

    mask = rng.standard_normal((20, 20))
    count = rng.uniform(0, 50, (20, 20))
    left = _beside_the_mask(3 + 2 * mask - 0.5 * mask**2 + 0.01 * field, mask, count)
    assert np.abs(left).max() < 0.05
    assert np.average(left, weights=count) == pytest.approx(0, abs=1e-9)
    assert len(cells.latitude_deg) > 10


def test_albedo_is_of_what_is_above_the_ground():
    found = cloud_albedo(np.array([0.1, 0.55, 1.2]), np.array([0.1, 0.1, 0.1]))
    np.testing.assert_allclose(found, [0.01, 0.5, 0.85])
