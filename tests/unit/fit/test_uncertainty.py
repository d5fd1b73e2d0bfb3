"""How sure fitted parameters are said to be, against fits of resampled images."""

import re
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
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

from cloudjax_fit.objective import (
    QUARTERS,
    pose,
    residuals,
    residuals_and_sums,
    simulate,
)
from cloudjax_fit.parameters import Parameters, unbounded_of
from cloudjax_fit.scene_parameters import scene_parameters
from cloudjax_fit.solver import Solution
from cloudjax_fit.statistics import COVERAGE_SCALE, SCALE
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
    images = flecked()
    made_of = SceneFromImagery(imagery, known={"low": small_class()}, seed=2, steps=12)
    free = [p for p in scene_parameters(made_of) if p.name in FREE]
    # Two vague enough for the data to decide, one less free to trade than usual.
    spreads = {"air.gain_C01": 1.0, "low.extinction": 3.0, "low.threshold": 0.25}
    free = [replace(p, spread=spreads.get(p.name, p.spread)) for p in free]
    target = small_target(imagery, images)
    problem, pixels = pose(
        target, made_of.build(), free, rays=576, seed=0, texture=False
    )
    return free, problem, pixels, images


@pytest.fixture(scope="module")
def found(posed):
    free, problem, *_ = posed
    z = unbounded_of(free)
    return _estimate(problem, free, _solution(problem, z))


def _estimate(problem, free, solution, noise=0.0):
    """Of a Jacobian of which each quarter is a quarter, but for noise."""
    z, quarter = unbounded_of(free), solution.jacobian / QUARTERS
    signs = np.array([1, -1, 1, -1])[:, None, None]
    return estimate(problem, free, z, solution, quarter + signs * noise, seed=0)


def _solution(problem, z) -> Solution:
    """A solver that has stopped where it started."""
    jacobian = eqx.filter_jit(jax.jacfwd(residuals))(z, problem)
    _, sums = eqx.filter_jit(residuals_and_sums)(z, problem)
    known = np.asarray(jacobian, float), [np.asarray(some, float) for some in sums]
    return Solution(np.asarray(z), True, "stopped", *known, (0.0,), 0.0)


@pytest.fixture(scope="module")
def resampled(posed):
    """Least squares by the steepest directions of fits to resampled blocks.

    Linear: each draw moves the residuals by what other blocks, the same in both, change
    in the observed and in the simulated histograms, and each prior by a standard
    deviation.
    """
    free, problem, pixels, images = posed
    z = unbounded_of(free)
    values = problem.parameters.values(z)
    seen, weights = eqx.filter_jit(simulate)(problem, values)
    jacobian = _by_differences(problem, z)
    rng = np.random.default_rng(1)
    block = block_of_pixels(SHAPE, BLOCKS)
    both = np.stack([images[1].reshape(-1), images[13].reshape(-1)])
    scene = small_imagery(FRACTION).empty_scene
    cloud = np.asarray(problem.rule.weights(jnp.asarray(both, float), scene))
    observed = _Pixels(both, cloud, block)
    simulated = _Pixels(np.asarray(seen), np.asarray(weights), block[pixels])
    moved = []
    for _ in range(DRAWS):
        blocks = rng.integers(0, 16, 16)
        change = simulated.of(blocks, problem) - observed.of(blocks, problem)
        others = rng.standard_normal(len(jacobian) - len(change))
        step, *_ = np.linalg.lstsq(jacobian, -np.append(change, others))
        moved.append(step)
    return np.std(moved, axis=0)


def _by_differences(problem, z):
    compiled = jax.jit(residuals)
    columns = []
    for i in range(len(z)):
        # Of the vaguest prior a hundredth is a change of 3 %: it bends the residuals.
        # Of the gain of the mask a thousandth is 4 % rounding, for it moves the steps.
        up, down = (compiled(z.at[i].add(s), problem) for s in (0.003, -0.003))
        columns.append((np.asarray(up) - np.asarray(down)) / 0.006)
    return np.array(columns, float).T


class _Pixels:
    """Pixels of an image with their weights, block by block."""

    def __init__(self, bands, weights, block):
        self.bands, self.weights, self.block = bands, weights, block

    def of(self, blocks, problem):
        index = np.concatenate([np.flatnonzero(self.block == b) for b in blocks])
        weights = self.weights[index]
        statistics = problem.statistics
        bins, rows = statistics.parts[0].bins, []
        for i, values in enumerate(self.bands):
            low, high = float(bins.low[i]), float(bins.high[i])
            inside = values[index] / float(statistics.deviations[i])
            edges = np.linspace(low, high, bins.count + 1)
            counts, _ = np.histogram(np.clip(inside, low, high), edges, weights=weights)
            rows.append(SCALE * np.cumsum(counts) / weights.sum())
        return np.append(np.concatenate(rows), COVERAGE_SCALE * weights.mean())


def test_deviations_are_those_of_fits_to_resampled_images(posed, found, resampled):
    """Geometry: 16 blocks of 36 pixels, two bands, one class of cloud.

    Tolerance: a sixth, for both are of some hundred draws, and differences of the
    histograms are not quite their slopes.
    """
    for i, (estimated, parameter) in enumerate(zip(found[0], posed[0], strict=True)):
        alone, z = Parameters.of([parameter]), unbounded_of([parameter])
        slope = float(jax.grad(lambda z, of=alone: of.values(z)[0])(z)[0])
        assert estimated.parameter == parameter
        assert estimated.std == pytest.approx(slope * resampled[i], rel=1 / 6)


def _spread(problem, free):
    z = unbounded_of(free)
    estimates, _ = _estimate(problem, free, _solution(problem, z))
    return {e.parameter.name: e.std for e in estimates}


def test_the_simulated_clouds_are_a_draw_too(posed):
    """Blocks that are all alike leave the observed histogram without doubt, and the
    parameters as unsure as the simulated one is."""
    free, problem, *_ = posed

    def alike(sums):
        return jnp.broadcast_to(sums.mean(0), sums.shape)

    sure = eqx.tree_at(
        lambda p: [one.observed for one in p.statistics.all], problem, replace_fn=alike
    )
    whole, simulated = _spread(problem, free), _spread(sure, free)
    for name in ("air.gain_C01", "low.extinction"):
        assert simulated[name] < 0.99 * whole[name]
        assert simulated[name] > 0.2 * whole[name]


def test_what_both_sides_share_is_no_doubt(posed):
    """Blocks may be as unlike as they are: where simulated ones are like the observed
    ones, block by block, another draw of blocks changes no residual."""
    free, problem, *_ = posed
    z = unbounded_of(free)
    known = _solution(problem, z)
    shared = [np.asarray(one.observed, float) for one in problem.statistics.all]
    assert all(some.std(0).max() > 0 for some in shared)
    equal, _ = _estimate(problem, free, replace(known, sums=shared))
    whole, _ = _estimate(problem, free, known)
    for one, other in zip(equal, whole, strict=True):
        # What is left comes from the rows of blocks and priors.
        if one.parameter.name == "air.gain_C01":
            assert one.std < 0.2 * other.std


def test_a_parameter_that_rounding_puts_onto_its_bound_stands_there(posed):
    """The logistic curve is flat there: no residual knows the parameter any more."""
    free, problem, *_ = posed
    z = unbounded_of(free).at[1].set(1e4)
    known = _solution(problem, z)
    assert not known.jacobian[:, 1].any()
    estimates, _ = _estimate(problem, free, known)
    assert [e.at_bound for e in estimates] == [False, True, False, False]
    assert not estimates[1].determined
    assert np.isfinite([e.std for e in estimates]).all()


def test_noise_of_the_jacobian_is_no_knowledge(posed):
    """Quarters of (1 ± s)/4: of the square of their sum s²/3 is noise, and a parameter
    is known by so much less, or, where nothing is left, as by its prior.

    Tolerance: 2 %, for the prior, vague, has a say.
    """
    free, problem, *_ = posed
    solution = _solution(problem, unbounded_of(free))
    gain = [p.name for p in free].index("air.gain_C01")
    rows = [*range(len(solution.jacobian) - len(free)), gain - len(free)]
    alone = eqx.tree_at(lambda p: p.parameters, problem, Parameters.of([free[gain]]))
    solution = replace(
        solution,
        z=solution.z[[gain]],
        jacobian=solution.jacobian[np.ix_(rows, [gain])],
    )

    def noisy(strength):
        noise = strength * solution.jacobian / QUARTERS
        return _estimate(alone, [free[gain]], solution, noise)[0][0]

    quiet, half, whole = (noisy(strength) for strength in (0.0, 1.0, 2.0))
    assert half.std / quiet.std == pytest.approx(np.sqrt(3 / 2), rel=0.02)
    assert whole.std == pytest.approx(free[gain].spread, rel=0.02)
    assert quiet.determined
    assert not whole.determined


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
