"""Four devices, and two processes, fit what one device fits."""

import equinox as eqx
import jax
import numpy as np
import pytest
from tests.other_processes import found_by
from tests.small_fits import flecked, small_class, small_imagery, small_target

from cloudjax_fit.fit_settings import FitSettings
from cloudjax_fit.fittable_scene import FittableScene
from cloudjax_fit.objective import residuals
from cloudjax_fit.parameters import unbounded_of


SETTINGS = FitSettings(rays=571, steps=3, seed=3, statistics="values")


@eqx.filter_jit
def _with_slopes(z, problem):
    def rows(z):
        found = residuals(z, problem)
        return found, found

    return jax.jacfwd(rows, has_aux=True)(z)


def compared() -> list[np.ndarray]:
    """Residuals and slopes of a fit whose rays no number of devices divides."""
    target = small_target(small_imagery(), flecked())
    known = {"low": small_class()}
    names = {p.name for p in FittableScene.of(target, SETTINGS, classes=known).free}
    held = {n: {"free": False} for n in names - {"low.threshold", "low.extinction"}}
    scene = FittableScene.of(target, SETTINGS, overrides=held, classes=known)
    found = _with_slopes(unbounded_of(scene.free), scene.pose())
    return [np.asarray(leaf) for leaf in found]


@pytest.fixture(scope="module")
def expected() -> list[np.ndarray]:
    return compared()


def _require_equal(found: list[np.ndarray], expected: list[np.ndarray]) -> None:
    for one, other in zip(found, expected, strict=True):
        scale = np.abs(other).max()
        assert scale > 1
        np.testing.assert_allclose(one, other, atol=2e-4 * scale)


@pytest.mark.slow
def test_four_devices_fit_what_one_fits(expected, tmp_path):
    """Tolerance: rounding of float32."""
    (found,) = found_by(compared, tmp_path, devices=4)
    _require_equal(found, expected)


def test_two_processes_fit_what_one_fits(expected, tmp_path):
    """Each has all of the result. Tolerance: as above."""
    for found in found_by(compared, tmp_path, processes=2):
        _require_equal(found, expected)
