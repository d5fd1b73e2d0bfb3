"""What a fit found."""

from dataclasses import dataclass, field

from cloudjax import Scene
from cloudjax_scenes.imagery_scene import SceneFromImagery
from cloudjax_scenes.simulated_image import SimulatedImage

from .fit_settings import FitSettings
from .histogram import Distances
from .parameters import Parameter
from .targets import Target
from .uncertainty import Estimate


# How a fit may end.
CONVERGED, NOT_CONVERGED, INTERRUPTED = "converged", "not converged", "interrupted"


@dataclass(frozen=True, eq=False)
class FitResult:
    """A `FitResult` is what a fit found.

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
        """Say how it ended, in a word or two."""
        return state_of(self.converged, self.interrupted)


def state_of(converged: bool, interrupted: bool) -> str:
    """Return how a fit ended, in a word or two."""
    if interrupted:
        return INTERRUPTED
    return CONVERGED if converged else NOT_CONVERGED
