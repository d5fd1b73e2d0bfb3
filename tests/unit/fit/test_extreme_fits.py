"""Scenes from which hardly anything can be fitted: what is said of them."""

import numpy as np
import pytest
from tests.generated import default_calibration, window, write_abi_l1b
from tests.scenes import NIGHT

from cloudjax_data import DataError
from cloudjax_fit.cautions import cautions
from cloudjax_fit.fit_inputs import read_inputs


SHAPE = (64, 64)


def _night(folder, **kelvin):
    """Bands of a night scene, by name such as c13."""
    for name, image in kelvin.items():
        band = int(name[1:])
        radiance = default_calibration(band).radiance(image)
        write_abi_l1b(
            folder, band=band, radiance=radiance, grid=window(SHAPE), start=NIGHT
        )
    return folder


def _half(east: bool) -> np.ndarray:
    """Cloud over seven tenths of one half."""
    rng = np.random.default_rng(1)
    cloud = (rng.random(SHAPE) < 0.7) & ((np.arange(64) >= 32) == east)
    return np.where(cloud, rng.uniform(225, 255, SHAPE), 288.0)


def test_one_cloud_pixel_is_too_few(tmp_path):
    clear = np.full(SHAPE, 288.0)
    clear[30, 30] = 230.0
    with pytest.raises(DataError, match=r"holds 1 cloud pixels .* needs 500"):
        read_inputs(_night(tmp_path, c13=clear))


def test_a_start_at_a_bound_is_refused(tmp_path):
    _night(tmp_path, c13=_half(True))
    text = '[parameters."thick_cold.extinction"]\ndefault = 1.0\n'
    (tmp_path / "scene.toml").write_text(text)
    with pytest.raises(DataError, match=r"scene.toml: thick_cold.extinction = 1 is"):
        read_inputs(tmp_path)


def test_bands_that_contradict_each_other_are_told(tmp_path):
    """What is cloud to band 13 is clear sky to band 15: a fit was a fault of the
    program."""
    inputs = read_inputs(_night(tmp_path, c13=_half(True), c15=_half(False)))
    earth = inputs.target.imagery.grid.sees_the_earth()
    (said,) = cautions(inputs.target, [], {}, earth)
    assert said.startswith("Band 15 is the same in all cloud pixels")
