"""A target becomes fitted parameters, their uncertainties and the simulated image."""

from collections.abc import Callable, Mapping

from cloudjax import CloudClass
from cloudjax_scenes.weather_analysis import Analysis

from .checkpoint import Checkpoint
from .fit_result import FitResult
from .fit_settings import FitSettings
from .fittable_scene import FittableScene
from .phases import Phases
from .solver import OnStep
from .solving import solve_and_estimate
from .targets import Target


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
    settings, phases = settings or FitSettings(), Phases()
    scene = FittableScene.of(target, settings, analysis, overrides, classes)
    problem = scene.pose()
    phases.lap("prepare")
    found = solve_and_estimate(
        problem, scene.free, settings, phases, on_step, stop, checkpoint
    )
    return scene.result(*found, phases)
