"""From a target to fitted parameters, their uncertainties and the simulated image."""

import functools as ft
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import jax.numpy as jnp
import numpy as np

from cloudjax import CloudClass, Scene
from cloudjax_scenes.imagery import Imagery
from cloudjax_scenes.imagery_scene import SceneFromImagery
from cloudjax_scenes.lights import PHYSICAL, light_named
from cloudjax_scenes.simulated_image import SimulatedImage, simulate_image
from cloudjax_scenes.weather_analysis import Analysis

from .cautions import cautions
from .checkpoint import Checkpoint
from .histogram import Distances, distances
from .objective import Problem, pose
from .parameters import Parameter, put_all, unbounded_of, values_of, with_overrides
from .scene_parameters import scene_parameters
from .solver import OnStep, Progress, Solution, Solver
from .targets import Target
from .uncertainty import Estimate, estimate


# What fits compare: radiances of single pixels, or neighbours and bands together too.
VALUES, TEXTURE = STATISTICS = "values", "texture"
# How a fit may end.
CONVERGED, NOT_CONVERGED, INTERRUPTED = "converged", "not converged", "interrupted"


@dataclass(frozen=True)
class FitSettings:
    """How a fit is done.

    **Fields:**

    - `rays`: pixels that are simulated at each step.
    - `steps`: of the march through each shell.
    - `starts`: the defaults, and this many less one drawn from the priors.
    - `max_steps`: of the solver from each start.
    - `seed`: of textures, rays, starts and bootstrap.
    - `statistics`: what is compared, one of `STATISTICS`: radiances alone, or texture
      too.
    - `light`: the strategy for sunlight, one of `cloudjax_scenes.LIGHTS`.
    """

    rays: int = 8192
    steps: int = 24
    starts: int = 1
    max_steps: int = 150
    seed: int = 0
    statistics: str = TEXTURE
    light: str = PHYSICAL.name

    def scene_from(
        self,
        imagery: Imagery,
        analysis: Analysis | None = None,
        classes: Mapping[str, CloudClass] | None = None,
        *,
        placed: bool = True,
    ) -> SceneFromImagery:
        """Return what the fitted scene is built of: see `SceneFromImagery`."""
        light = light_named(self.light)
        return SceneFromImagery(
            imagery, analysis, light, classes, self.seed, self.steps, placed
        )


@dataclass(frozen=True, eq=False)
class FitResult:
    """What a fit found.

    **Fields:**

    - `target`, `made_of`: what was fitted, and what its scene was built of.
    - `converged`, `status`: whether the solver did, and what it says.
    - `interrupted`: whether it was told to stop before its end.
    - `scene`: with the fitted parameters.
    - `estimates`: of every free parameter; `held`: the others.
    - `undetermined`: combinations that the data leave to the priors, in words.
    - `start`, `image`: simulated with the parameters before and after.
    - `distances_start`, `distances_fit`: by band.
    - `history`: loss after each step; `seconds`: wall time by phase.
    - `warnings`: what to mind before believing it.
    """

    target: Target
    made_of: SceneFromImagery
    settings: FitSettings
    converged: bool
    status: str
    scene: Scene
    estimates: list[Estimate]
    held: list[Parameter]
    undetermined: list[str]
    start: SimulatedImage
    image: SimulatedImage
    distances_start: dict[int, Distances]
    distances_fit: dict[int, Distances]
    history: tuple[float, ...]
    seconds: dict[str, float]
    warnings: list[str] = field(default_factory=list)
    interrupted: bool = False

    @property
    def state(self) -> str:
        """How it ended, in a word or two."""
        if self.interrupted:
            return INTERRUPTED
        return CONVERGED if self.converged else NOT_CONVERGED


def fit(
    target: Target,
    analysis: Analysis | None = None,
    *,
    settings: FitSettings | None = None,
    overrides: Mapping[str, Mapping] | None = None,
    classes: Mapping[str, CloudClass] | None = None,
    on_step: OnStep | None = None,
    stop: Callable[[], bool] = lambda: False,
    checkpoint: Checkpoint | None = None,
) -> FitResult:
    """Fit a scene of clouds to the histograms of a target.

    **Arguments:**

    - `analysis`: the weather of that hour: winds that draw the textures, temperatures.
    - `overrides`: changes of parameters by name, such as `{"cirrus.top": {"default":
      9000.0, "free": False}}`.
    - `classes`: of cloud; by default those that the light has for imagery.
    - `on_step`: called with the number and loss of each step.
    - `stop`: asked after each step whether to end with the best so far.
    - `checkpoint`: written after each step, and gone on from where it holds one of the
      same fit; it stays until it is removed.

    **Raises:** `ValueError` for an override that does not exist or contradicts itself.
    """
    settings = settings or FitSettings()
    clock = _Clock()
    made_of = settings.scene_from(target.imagery, analysis, classes)
    parameters = with_overrides(scene_parameters(made_of), overrides or {})
    defaults = jnp.asarray([p.default for p in parameters])
    scene = put_all(made_of.build(), parameters, defaults)
    free = [p for p in parameters if p.free]
    problem, _ = pose(
        target,
        scene,
        free,
        rays=settings.rays,
        seed=settings.seed,
        texture=settings.statistics == TEXTURE,
    )
    clock.lap("prepare")
    solver = Solver(problem, max_steps=settings.max_steps, on_step=on_step, stop=stop)
    clock.lap("compile")
    starts = draw_starts(free, settings.starts, settings.seed)
    solutions = [*_solutions(solver, problem, starts, checkpoint or Checkpoint())]
    best = min(solutions, key=_merit)
    interrupted = solutions[-1].interrupted
    clock.lap("solve")
    estimates, undetermined = estimate(
        problem, free, starts[0], best, seed=settings.seed
    )
    clock.lap("uncertainty")
    fitted = put_all(scene, free, values_of(free, jnp.asarray(best.z)))
    start = simulate_image(scene, made_of)
    image = simulate_image(fitted, made_of)
    clock.lap("render")
    depths = {
        layer.name: depth
        for layer, depth in zip(fitted.layers, image.depths, strict=True)
    }
    earth = np.isfinite(image.radiance[0])
    return FitResult(
        target=target,
        made_of=made_of,
        settings=settings,
        converged=best.converged and not interrupted,
        status=_status(solutions, best, len(starts)),
        scene=fitted,
        estimates=estimates,
        held=[p for p in parameters if not p.free],
        undetermined=undetermined,
        start=start,
        image=image,
        distances_start=_distances(target, start),
        distances_fit=_distances(target, image),
        history=best.history,
        seconds=clock.seconds,
        warnings=[*cautions(target, estimates, depths, earth), *made_of.notes],
        interrupted=interrupted,
    )


def draw_starts(parameters: Sequence[Parameter], count: int, seed: int):
    """The defaults first, then draws from the priors."""
    first = unbounded_of(parameters)
    rng = np.random.default_rng(seed)
    others = rng.standard_normal((count - 1, len(parameters)))
    return [first, *(jnp.asarray(z, first.dtype) for z in others)]


def _solutions(
    solver: Solver, problem: Problem, starts: Sequence, checkpoint: Checkpoint
) -> Iterator[Solution]:
    """From one start after the other, until the solver is told to stop."""
    progress = checkpoint.read(lambda: solver.begin(starts[0]))
    begun = dict(enumerate(progress))

    def keep(i: int, at: Progress) -> None:
        begun[i] = at
        checkpoint.write(list(begun.values()))

    for i, z in enumerate(starts):
        at = begun.get(i) or solver.begin(z)
        solution = solver.go_on(problem, at, ft.partial(keep, i))
        yield solution
        if solution.interrupted:
            return


def _status(solutions: Sequence[Solution], best: Solution, starts: int) -> str:
    if not solutions[-1].interrupted or starts == 1:
        return best.message
    return f"start {len(solutions)} of {starts}: {solutions[-1].message}"


def _merit(solution: Solution) -> tuple[bool, float]:
    return not solution.converged, solution.loss


def _distances(target: Target, image: SimulatedImage) -> dict[int, Distances]:
    counted = target.good
    weights = image.cloud[counted]
    return {
        number: distances(table, image.band(number)[counted], weights)
        for number, table in target.quantiles.items()
    }


class _Clock:
    """Wall time by phase."""

    def __init__(self):
        self._phases: dict[str, float] = {}
        self._started = self._last = time.perf_counter()

    def lap(self, phase: str) -> None:
        now = time.perf_counter()
        self._phases[phase] = now - self._last
        self._last = now

    @property
    def seconds(self) -> dict[str, float]:
        return {**self._phases, "total": self._last - self._started}
