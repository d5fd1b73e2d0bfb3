"""What a whole fit puts into its result: before, after, and by which sun and seed."""

import math
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

from cloudjax import FractalCloud
from cloudjax_fit import fit, scene_parameters
from cloudjax_fit.fit_result import FitResult
from cloudjax_fit.fit_settings import FitSettings
from cloudjax_fit.objective import (
    BLOCK_FLOOR,
    BLOCK_SPREAD,
    pose,
    residuals,
    simulate,
)
from cloudjax_fit.observation import BINS
from cloudjax_fit.parameters import put_all, unbounded_of, values_of
from cloudjax_fit.ray_choice import DRAWS
from cloudjax_fit.solver import Progress, Solution, Solver, creeps
from cloudjax_fit.solving import draw_starts
from cloudjax_fit.statistics import COVERAGE_SCALE, SCALE
from cloudjax_fit.targets import block_of_pixels
from cloudjax_scenes import simulate_image


SETTINGS = FitSettings(rays=576, steps=5, max_steps=6, seed=3, statistics="values")
HELD = {
    name: {"free": False}
    for name in (
        "low.mask_gain",
        "low.infrared_ratio",
        "low.barrier_scale",
        "air.path_C01",
        "air.temperature_offset",
        "air.gain_C13",
    )
}
CHANGED = HELD | {"low.top": {"default": 900.0, "free": False}}
KNOWN = {"low": small_class()}


@pytest.fixture(scope="module")
def target():
    """Half the sky is cloud in the north, an eighth in the south."""
    fraction = np.linspace(0.1, 0.9, 8)[:, None] * np.ones(8)
    return small_target(small_imagery(fractions={"low": fraction}), flecked())


@pytest.fixture(scope="module")
def result(target) -> FitResult:
    return fit(target, settings=SETTINGS, overrides=CHANGED, classes=KNOWN)


def _defaults(result):
    """The scene that the fit starts from, put together once more."""
    parameters = scene_parameters(result.made_of)
    values = [900.0 if p.name == "low.top" else p.default for p in parameters]
    scene = put_all(result.made_of.build(), parameters, jnp.asarray(values))
    return scene


def _w1(observed, simulated, weights):
    """The area between two quantile functions, by sorting."""
    order = np.argsort(simulated)
    share = (np.cumsum(weights[order]) - 0.5 * weights[order]) / weights.sum()
    middle = (np.arange(4000) + 0.5) / 4000
    nearest = np.interp(middle, share, simulated[order])
    wanted = np.interp(middle, observed.probabilities, observed.values)
    return np.abs(nearest - wanted).mean()


@pytest.mark.parametrize("number", [1, 13])
def test_distances_are_those_of_the_images_before_and_after(result, number):
    """Tolerance: 3 %, for the quantiles of few pixels are read between them."""
    observed = result.target.quantiles[number]
    expected = [
        _w1(observed, image.band(number).reshape(-1), image.cloud.reshape(-1))
        for image in (result.start, result.image)
    ]
    found = [d[number].w1 for d in (result.distances_start, result.distances_fit)]
    np.testing.assert_allclose(found, expected, rtol=0.03)
    if number == 1:
        assert abs(found[0] / found[1] - 1) > 0.1


def test_the_start_is_the_scene_of_the_defaults(result):
    start = simulate_image(_defaults(result), result.made_of)
    np.testing.assert_allclose(result.start.radiance, start.radiance, rtol=1e-5)
    np.testing.assert_allclose(result.start.cloud, start.cloud, atol=1e-5)
    assert [e.start for e in result.estimates] == pytest.approx(
        [e.parameter.default for e in result.estimates], rel=1e-5
    )


def test_the_image_is_the_scene_of_the_values_that_are_told(result):
    """By the estimates, with what is held at the values of the settings."""
    found = [e.parameter for e in result.estimates]
    assert not {p.name for p in found} & set(CHANGED)
    assert {p.name for p in result.held} == set(CHANGED)
    assert {p.name: p.default for p in result.held}["low.top"] == 900.0
    values = jnp.asarray([e.value for e in result.estimates])
    scene = put_all(_defaults(result), found, values)
    cloud = scene.layers[0].cloud
    assert isinstance(cloud, FractalCloud)
    assert float(cloud.function.top_m) == 900.0
    image = simulate_image(scene, result.made_of)
    np.testing.assert_allclose(result.image.radiance, image.radiance, rtol=1e-4)
    moved = np.abs(result.image.radiance / result.start.radiance - 1)
    assert moved.max() > 0.02


def test_the_seed_is_that_of_the_settings(result):
    assert result.made_of.seed == 3
    other = replace(result.made_of, seed=4)
    image = simulate_image(_defaults(replace(result, made_of=other)), other)
    assert np.abs(image.radiance / result.start.radiance - 1).max() > 0.1


@pytest.fixture(scope="module")
def posed(target, result):
    """All pixels, at the parameters that the fit has found."""
    free = [e.parameter for e in result.estimates]
    return pose(target, result.scene, free, rays=10_000, seed=0, texture=False)


def test_what_is_fitted_is_what_is_rendered(result, posed):
    """The rays of a fit and the pixels of its image are the same where the rays see the
    draw of the clouds that is the scene's own; the others see others.
    """
    problem, pixels = posed
    np.testing.assert_array_equal(pixels, np.arange(SHAPE[0] * SHAPE[1]))
    values = jnp.asarray([e.value for e in result.estimates])
    seen, weights = eqx.filter_jit(simulate)(problem, values)
    image = result.image.radiance.reshape(2, -1)
    own = pixels % DRAWS == 0
    np.testing.assert_allclose(seen[:, own], image[:, own], rtol=2e-4)
    cloud = result.image.cloud.reshape(-1)
    np.testing.assert_allclose(weights[own], cloud[own], atol=2e-3)
    for draw in range(1, DRAWS):
        other = pixels % DRAWS == draw
        assert np.abs(seen[:, other] / image[:, other] - 1).max() > 0.1


def test_the_sun_stands_where_it_stood(posed):
    """20:00:30 UTC on 27 October: 16 minutes before a mean clock, 12.9 degrees south.

    The equation of time and the declination are those of an almanac; tolerance: half
    a degree, two minutes of the day.
    """
    hours = 20 + 0.5 / 60 + 16.1 / 60
    east, north = np.radians([15 * (12 - hours), -12.9])
    expected = [
        np.cos(north) * np.cos(east),
        np.cos(north) * np.sin(east),
        np.sin(north),
    ]
    towards = np.asarray(posed[0].view.around.sun_direction)
    apart = np.degrees(np.arccos(np.clip(towards @ expected, -1, 1)))
    assert apart.max() < 0.5


def test_residuals_are_those_of_histograms_cover_and_priors(result, posed):
    """By numpy, pixel by pixel. Tolerance of the histograms: what half a bin changes,
    for the fit spreads each pixel over three."""
    problem, _ = posed
    parameters = [e.parameter for e in result.estimates]
    start = {e.parameter.name: e.value for e in result.estimates}
    z = unbounded_of(parameters, start)
    values = problem.parameters.values(z)
    seen, weights = (np.asarray(x) for x in eqx.filter_jit(simulate)(problem, values))
    found = np.asarray(eqx.filter_jit(residuals)(z, problem))
    shape, rest = np.split(found, [2 * BINS])
    target = result.target
    histograms = target.statistics.parts[0]
    observed = np.asarray(histograms.observed).sum(0)
    for i, wanted in enumerate(observed):
        low, high = (
            float(end[i]) for end in (histograms.bins.low, histograms.bins.high)
        )
        edges = np.linspace(low, high, BINS + 1)
        radiance = seen[i] / float(target.statistics.deviations[i])
        counts, _ = np.histogram(np.clip(radiance, low, high), edges, weights=weights)
        # The fit spreads each pixel over three bins.
        counts = np.convolve(counts, [0.125, 0.75, 0.125], "same")
        sharp = np.cumsum(counts) / weights.sum() - np.cumsum(wanted) / wanted.sum()
        row = shape[BINS * i : BINS * (i + 1)]
        assert np.abs(row - SCALE * sharp).max() < 0.3 * np.abs(row).max()
    share = target.block_cloud.sum() / target.block_valid.sum()
    assert rest[0] == pytest.approx(COVERAGE_SCALE * (weights.mean() - share), abs=1e-2)
    block = block_of_pixels(SHAPE, BLOCKS)
    covered = np.array([weights[block == b].mean() for b in range(16)])
    f = target.block_cloud / target.block_valid
    # Another draw changes the share of a block by 15 % at a half, 3 % where clear.
    spread = np.hypot(BLOCK_FLOOR, 2 * BLOCK_SPREAD * np.sqrt(f * (1 - f)))
    np.testing.assert_allclose(rest[1:17], (covered - f) / spread, atol=2e-3)
    gap = [
        (np.log(v) - np.log(p.default) if p.log else v - p.default) / p.spread
        for p, v in zip(parameters, np.asarray(values, float), strict=True)
    ]
    np.testing.assert_allclose(rest[17:], gap, atol=1e-3)


def test_blocks_are_counted_row_by_row():
    block = block_of_pixels((4, 9), (2, 3)).reshape(4, 9)
    np.testing.assert_array_equal(block[0], [0, 0, 0, 1, 1, 1, 2, 2, 2])
    np.testing.assert_array_equal(block[:, 0], [0, 0, 3, 3])


def test_rays_are_drawn_anew_for_another_seed(target, result):
    drawn = [
        pose(target, result.scene, (), rays=40, seed=s, texture=False)[1]
        for s in (0, 0, 1)
    ]
    assert (drawn[0] == drawn[1]).all()
    assert len(np.intersect1d(drawn[0], drawn[2])) < 20
    assert all(len(np.unique(some)) == 40 for some in drawn)


def test_starts_are_the_defaults_and_draws_of_the_priors(result):
    free = [e.parameter for e in result.estimates]
    first, *others = draw_starts(free, 200, seed=0)
    np.testing.assert_allclose(
        values_of(free, first), [p.default for p in free], rtol=1e-5
    )
    assert np.std(others, axis=0) == pytest.approx(1.0, abs=0.2)
    again, other = (draw_starts(free, 3, seed=s)[2] for s in (0, 1))
    np.testing.assert_array_equal(again, others[1])
    assert not np.allclose(other, others[1])


@pytest.mark.parametrize("wins", [0, 1, 2])
def test_the_best_start_is_kept(target, monkeypatch, wins):
    """Of those that converged, the one of the least loss, wherever it comes."""
    taken = []

    class OneOfThree(Solver):
        def __init__(self, problem, **_):
            self.count = 0

        def begin(self, z):
            return Progress(z, None)

        def go_on(self, problem, begun, on_progress=None):
            z = begun.z
            i, self.count = self.count, self.count + 1
            converged, loss = (True, 1.0) if i == wins else (i != (wins + 1) % 3, 2.0)
            loss = loss if converged else 0.5
            none = np.zeros((1, len(z)))
            end = np.asarray(z) + i
            return Solution(end, converged, f"{i}", none, [], (9.0, loss), 0.1)

        def quarters(self, problem, z):
            return np.zeros((4, 1, len(z)))

    def stop(problem, parameters, z_start, solution, quarters, *, seed):
        taken.append((z_start, solution.z))
        raise StopIteration

    monkeypatch.setattr("cloudjax_fit.solving.Solver", OneOfThree)
    monkeypatch.setattr("cloudjax_fit.solving.estimate", stop)
    settings = replace(SETTINGS, starts=3, rays=20)
    with pytest.raises(StopIteration):
        fit(target, settings=settings, overrides=CHANGED, classes=KNOWN)
    ((z_start, z_fit),) = taken
    parameters = [
        p
        for p in scene_parameters(settings.scene_from(target.imagery, None, KNOWN))
        if p.name not in CHANGED
    ]
    starts = draw_starts(parameters, 3, settings.seed)
    np.testing.assert_allclose(z_start, starts[0], atol=1e-6)
    np.testing.assert_allclose(z_fit, starts[wins] + wins, atol=1e-6)


@pytest.fixture(scope="module")
def solver(posed):
    """Compiled once for the tests of what it does."""
    problem, _ = posed
    return Solver(problem, max_steps=60)


def test_the_jacobian_of_a_solution_is_that_of_the_residuals(
    posed, solver, monkeypatch
):
    """Where the solver stops, not where it tried last. Tolerance: float32.

    By a derivative along all parameters at once, each as strong as the others.
    """
    problem, _ = posed
    monkeypatch.setattr(solver, "_max_steps", 3)
    z = jnp.full(len(problem.parameters), 0.3)
    solution = solver(problem, z)
    assert np.abs(solution.z - z).max() > 0.01
    along = 1 / np.abs(solution.jacobian).max(0)

    @jax.jit
    def slopes(z, along):
        return jax.jvp(lambda z: residuals(z, problem), (z,), (along,))[1]

    expected = slopes(jnp.asarray(solution.z), jnp.asarray(along, z.dtype))
    np.testing.assert_allclose(solution.jacobian @ along, expected, atol=2e-3)


def test_scenes_of_one_structure_share_the_compiled_step(posed, monkeypatch):
    """A problem of other numbers is not compiled again, one of another rule is."""
    problem, _ = posed
    Solver(problem)

    def compiled(problem):
        raise StopIteration

    monkeypatch.setattr("cloudjax_fit.solver._compiled_step", compiled)
    Solver(replace(problem, known=0.5 * problem.known))
    with pytest.raises(StopIteration):
        Solver(replace(problem, rule=replace(problem.rule, cold_temperature_k=200.0)))


def test_quarters_of_the_draws_share_a_jacobian(posed, solver):
    """What rays of a quarter move by themselves; of all rays it is the sum of them."""
    problem, _ = posed
    z = np.full(len(problem.parameters), 0.3, np.float32)
    quarters = solver.quarters(problem, z)
    whole = np.asarray(jax.jit(jax.jacfwd(residuals))(jnp.asarray(z), problem))
    data = slice(0, -len(z))
    tolerance = 2e-3 * np.abs(whole).max(0)
    assert (np.abs(quarters.sum(0) - whole)[data] < tolerance).all()
    priors = np.broadcast_to(whole[-len(z) :], quarters[:, -len(z) :].shape)
    np.testing.assert_allclose(quarters[:, -len(z) :], priors, rtol=1e-6)
    first = solver.quarters(replace(problem, draw=0 * problem.draw), z)
    assert (np.abs(first[0] - whole) < tolerance).all()
    assert not first[1:, data].any()


LEAPS = [980.0, 985.0, 979.0, 978.0, 975.0]


@pytest.mark.parametrize(
    ("losses", "stops"),
    [
        ([5000.0, 1000.0, 999.9, 999.8, 999.7, 999.6, 999.5], True),
        # One step less, or one that gained.
        ([5000.0, 1000.0, 999.9, 999.8, 999.7, 999.6], False),
        ([5000.0, 1000.0, 999.9, 999.8, 998.0, 997.9, 997.8], False),
        # Little worse is as good as nothing gained; far worse were leaps.
        ([5000.0, 970.0, 970.5, 970.3, 970.2, 970.1, 970.05], True),
        ([5000.0, 970.0, *LEAPS], False),
        ([5000.0, 970.0, *LEAPS, 969.9, 969.8, 969.7, 969.6, 969.5], True),
        ([5000.0, 970.0, *[math.nan] * 6], False),
    ],
)
def test_a_solver_creeps_where_its_steps_gain_next_to_nothing(losses, stops):
    assert creeps(losses) is stops
    assert not any(creeps(losses[:n]) for n in range(len(losses)))


def test_a_solver_that_creeps_has_converged(posed, solver, monkeypatch):
    """Without a tolerance it would go on until its steps are used up."""
    advance = solver._advance
    monkeypatch.setattr(
        solver, "_advance", lambda *at: replace(advance(*at), ends=False)
    )
    problem, _ = posed
    solution = solver(problem, jnp.zeros(len(problem.parameters)))
    assert len(solution.history) - 1 < 60
    assert solution.converged
    assert solution.message.endswith(": the last 5 gained less than 0.1%")
    assert solution.loss < 1.001 * min(solution.history)
