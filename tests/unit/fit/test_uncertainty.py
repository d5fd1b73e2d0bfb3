"""How sure fitted parameters are said to be, against fits of resampled images."""

import re
from dataclasses import replace

import equinox as eqx
import jax
import numpy as np
import pytest
from tests.small_fits import (
    BLOCKS,
    SHAPE,
    flecked,
    small_class,
    small_imagery,
    small_target,
)

from cloudjax_fit.objective import COVERAGE_SCALE, SCALE, pose, residuals, simulate
from cloudjax_fit.parameters import unbounded_of, values_of
from cloudjax_fit.scene_parameters import scene_parameters
from cloudjax_fit.solver import Solution
from cloudjax_fit.targets import block_of_pixels
from cloudjax_fit.uncertainty import estimate
from cloudjax_scenes import SceneFromImagery


FREE = ("low.mask_gain", "low.threshold", "low.extinction", "air.gain_C01")
FRACTION, MASK = 0.6, 0.2533  # the mask is the probit of the fraction
DRAWS = 600


@pytest.fixture(scope="module")
def posed():
    """Four parameters, of which two act as one: the cover is the same everywhere."""
    imagery = small_imagery(FRACTION)
    images, cloud = flecked()
    made_of = SceneFromImagery(imagery, known={"low": small_class()}, seed=2, steps=6)
    free = [p for p in scene_parameters(made_of) if p.name in FREE]
    # Two vague enough for the data to decide, one less free to trade than usual.
    spreads = {"air.gain_C01": 1.0, "low.extinction": 3.0, "low.threshold": 0.25}
    free = [replace(p, spread=spreads.get(p.name, p.spread)) for p in free]
    target = small_target(imagery, images, cloud)
    problem, pixels = pose(target, made_of.build(), free, rays=576, seed=0)
    return target, problem, pixels, images, cloud


@pytest.fixture(scope="module")
def found(posed):
    target, problem, *_ = posed
    z = unbounded_of(problem.parameters)
    return estimate(problem, target, z, _solution(problem, z), seed=0)


def _solution(problem, z) -> Solution:
    """A solver that has stopped where it started."""
    jacobian = np.asarray(eqx.filter_jit(jax.jacfwd(residuals))(z, problem), float)
    return Solution(np.asarray(z), True, "stopped", jacobian, (0.0,), 0.0)


@pytest.fixture(scope="module")
def resampled(posed):
    """Least squares by the steepest directions of fits to resampled blocks.

    Linear: each draw moves the residuals by what other blocks change in the observed
    and in the simulated histograms, and each prior by a standard deviation.
    """
    target, problem, pixels, images, cloud = posed
    z = unbounded_of(problem.parameters)
    values = values_of(problem.parameters, z)
    seen, weights = eqx.filter_jit(simulate)(problem, values)
    jacobian = _by_differences(problem, z)
    rng = np.random.default_rng(1)
    block = block_of_pixels(SHAPE, BLOCKS)
    observed = _Pixels(
        [images[1].reshape(-1), images[13].reshape(-1)],
        cloud.reshape(-1).astype(float),
        block,
    )
    simulated = _Pixels(list(np.asarray(seen)), np.asarray(weights), block[pixels])
    moved = []
    for _ in range(DRAWS):
        change = simulated.drawn(rng, target) - observed.drawn(rng, target)
        others = rng.standard_normal(len(jacobian) - len(change))
        step, *_ = np.linalg.lstsq(jacobian, -np.append(change, others))
        moved.append(step)
    return np.std(moved, axis=0)


def _by_differences(problem, z):
    compiled = jax.jit(residuals)
    columns = []
    for i in range(len(z)):
        # Of the vaguest prior a hundredth is a change of 3 %: it bends the residuals.
        up, down = (compiled(z.at[i].add(s), problem) for s in (0.001, -0.001))
        columns.append((np.asarray(up) - np.asarray(down)) / 0.002)
    return np.array(columns, float).T


class _Pixels:
    """Pixels of an image with their weights, which are drawn block by block."""

    def __init__(self, bands, weights, block):
        self.bands, self.weights, self.block = bands, weights, block

    def drawn(self, rng, target):
        chosen = rng.integers(0, 16, 16)
        index = np.concatenate([np.flatnonzero(self.block == b) for b in chosen])
        weights = self.weights[index]
        rows = []
        for values, band in zip(self.bands, target.statistics.values(), strict=True):
            edges = np.linspace(band.low, band.high, band.block_counts.shape[1] + 1)
            inside = np.clip(values[index], band.low, band.high)
            counts, _ = np.histogram(inside, edges, weights=weights)
            rows.append(SCALE * np.cumsum(counts) / weights.sum())
        return np.append(np.concatenate(rows), COVERAGE_SCALE * weights.mean())


def test_deviations_are_those_of_fits_to_resampled_images(posed, found, resampled):
    """Geometry: 16 blocks of 36 pixels, two bands, one class of cloud.

    Tolerance: a sixth, for both are of some hundred draws, and differences of the
    histograms are not quite their slopes.
    """
    parameters = posed[1].parameters
    for i, (estimated, parameter) in enumerate(zip(found[0], parameters, strict=True)):
        z = unbounded_of(parameters)[i]
        slope = float(jax.grad(parameter.value)(z))
        assert estimated.parameter == parameter
        assert estimated.std == pytest.approx(slope * resampled[i], rel=1 / 6)


def _spread(target, problem):
    z = unbounded_of(problem.parameters)
    estimates, _ = estimate(problem, target, z, _solution(problem, z), seed=0)
    return {e.parameter.name: e.std for e in estimates}


def test_the_simulated_clouds_are_a_draw_too(posed):
    """Blocks that are all alike leave the observed histogram without doubt, and the
    parameters as unsure as the simulated one is."""
    target, problem, *_ = posed
    alike = {
        n: replace(band, block_counts=np.tile(band.block_counts.sum(0), (16, 1)))
        for n, band in target.statistics.items()
    }
    cloud = np.full(16, target.block_cloud.sum())
    sure = replace(
        target, statistics=alike, block_cloud=cloud, block_valid=cloud * 576 // cloud
    )
    whole, simulated = _spread(target, problem), _spread(sure, problem)
    for name in ("air.gain_C01", "low.extinction"):
        assert simulated[name] < 0.99 * whole[name]
        assert simulated[name] > 0.2 * whole[name]


def _named(sentence: str) -> dict[str, float]:
    terms = re.findall(r"([+-][\d.]+) ([a-z]\S+)", sentence)
    return {name: float(number) for number, name in terms}


def test_what_the_data_leave_open_is_named(found):
    """Only g w - T enters where w is one number: along (1, w) nothing changes.

    In units of the priors that is (1/0.4, w/0.25), and known as the priors alone.
    """
    estimates, said = found
    direction = np.array([1 / 0.4, MASK / 0.25])
    direction /= np.linalg.norm(direction)
    assert said
    expected = pytest.approx(dict(zip(FREE[:2], direction, strict=True)), abs=0.03)
    (sentence,) = (words for words in said if _named(words) == expected)
    assert float(sentence.split(" is known to ")[1].split()[0]) == pytest.approx(1, 0.1)
    by_name = {e.parameter.name: e for e in estimates}
    assert not by_name["low.mask_gain"].determined
    assert by_name["air.gain_C01"].determined
    assert not any("air.gain_C01" in words for words in said), said
