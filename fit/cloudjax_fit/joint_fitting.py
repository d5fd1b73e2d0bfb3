"""One fit to several scenes, which have the parameters of their clouds in common."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

from cloudjax_data import DataError
from cloudjax_scenes.simulated_image import SimulatedImage, simulate_image

from .checkpoint import Checkpoint
from .fit_result import FitResult, state_of
from .fit_settings import FitSettings
from .fittable_scene import FittableScene
from .histogram import Distances
from .joint_problem import JointProblem
from .parameters import Parameters
from .phases import Phases
from .sharing import JoinedParameters, Sharing, join
from .solver import OnStep, Solution
from .solving import solve_and_estimate
from .uncertainty import Estimate


# Of each scene: histograms of fewer are noise. A fit to one scene has four times as
# many, of which several scenes together have their share.
FEWEST_RAYS = 2048
# What must be the same for all scenes.
_COMMON = "light", "statistics", "starts", "max_steps", "seed"


@dataclass(frozen=True, eq=False)
class TestedScene:
    """A `TestedScene` was not fitted; it is seen with the clouds of others.

    **Fields:**

    - `values`: of all parameters: shared ones of the fit, else the scene's defaults.
    - `image`: simulated with these.
    - `distances_start`, `distances_fit`: by band, with the defaults and of `image`.
    """

    scene: FittableScene
    values: dict[str, float]
    image: SimulatedImage
    distances_start: dict[int, Distances]
    distances_fit: dict[int, Distances]

    @property
    def cloud_fractions(self) -> dict[str, float]:
        """Return the share of the good pixels that counts as cloud, observed and in
        `image`.
        """
        target = self.scene.target
        simulated = float(self.image.cloud[target.good].mean())
        return {"observed": target.cloud_fraction, "simulated": simulated}


@dataclass(frozen=True, eq=False)
class JointFit:
    """A `JointFit` is what a joint fit found.

    **Fields:**

    - `scenes`: that were fitted; `joined`: their parameters.
    - `solution`, `status`: where the solver ended, and how in words.
    - `estimates`: of `joined.parameters`; `undetermined`: as of `FitResult`.
    - `phases`: wall time.
    """

    scenes: Sequence[FittableScene]
    joined: JoinedParameters
    solution: Solution
    status: str
    estimates: list[Estimate]
    undetermined: list[str]
    phases: Phases

    @property
    def settings(self) -> FitSettings:
        """Tell how it was done; rays and steps are those of the first scene."""
        return self.scenes[0].settings

    @property
    def state(self) -> str:
        """Say how it ended, in a word or two."""
        return state_of(self.solution.converged, self.solution.interrupted)

    @property
    def shared(self) -> dict[str, Estimate]:
        """Give what was found of the parameters in common, by name."""
        names = self.joined.shared
        return {
            e.parameter.name: e for e in self.estimates if e.parameter.name in names
        }

    def results(self) -> Iterator[FitResult]:
        """Render one scene after the other, and yield what was found of it."""
        for scene, places in zip(self.scenes, self.joined.places, strict=True):
            found = [
                replace(self.estimates[i], parameter=parameter)
                for i, parameter in zip(places, scene.free, strict=True)
            ]
            yield scene.result(
                self.solution, self.status, found, self.undetermined, self.phases
            )

    def tested(self, scene: FittableScene) -> TestedScene:
        """See a scene that was not fitted, with the shared parameters.

        **Raises:** `DataError` if its light is another.
        """
        _require_common([self.scenes[0], scene], ("light",))
        shared = {name: found.value for name, found in self.shared.items()}
        values = {p.name: shared.get(p.name, p.default) for p in scene.parameters}
        start = simulate_image(scene.scene, scene.made_of)
        image = simulate_image(scene.with_values(values), scene.made_of)
        of = scene.target.distances
        return TestedScene(scene, values, image, of(start), of(image))


def joint_fit(
    scenes: Sequence[FittableScene],
    sharing: Sharing,
    *,
    on_step: OnStep | None = None,
    stop: Callable[[], bool] = lambda: False,
    checkpoint: Checkpoint | None = None,
) -> JointFit:
    """Fit several scenes together.

    **Arguments:**

    - `sharing`: which parameters they have in common.
    - `on_step`, `stop`, `checkpoint`: as of `cloudjax_fit.fit`.

    **Raises:** `DataError` if the scenes are to be fitted in different ways, or say
    different things of what they share.
    """
    phases = Phases()
    _require_common(scenes)
    settings, joined = scenes[0].settings, join(scenes, sharing)
    problem = JointProblem.of(
        Parameters.of(joined.parameters),
        [scene.pose(_rays(scene.settings.rays, len(scenes))) for scene in scenes],
        joined.places,
    )
    phases.lap("prepare")
    found = solve_and_estimate(
        problem, joined.parameters, settings, phases, on_step, stop, checkpoint
    )
    return JointFit(scenes, joined, *found, phases)


def _rays(rays: int, scenes: int) -> int:
    """Of one of so many scenes: its share, and enough for histograms."""
    return max(rays // scenes, min(rays, FEWEST_RAYS))


def _require_common(
    scenes: Sequence[FittableScene], keys: Sequence[str] = _COMMON
) -> None:
    for other in scenes[1:]:
        for key in keys:
            a, b = (getattr(s.settings, key) for s in (scenes[0], other))
            if a != b:
                raise DataError(
                    f"{scenes[0].name} asks for {key} = {a} and {other.name} for {b}: "
                    f"scenes that are fitted together need the same."
                )
