"""A target and the scene that is to look like it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import jax.numpy as jnp

from cloudjax import CloudClass, Scene
from cloudjax_scenes.imagery_scene import SceneFromImagery
from cloudjax_scenes.simulated_image import simulate_image
from cloudjax_scenes.weather_analysis import Analysis

from .cautions import cautions
from .fit_result import FitResult
from .fit_settings import TEXTURE, FitSettings
from .objective import Problem, pose
from .parameters import Parameter, put_all, with_overrides
from .phases import Phases
from .scene_parameters import scene_parameters
from .solver import Solution
from .targets import Target
from .uncertainty import Estimate


@dataclass(frozen=True, eq=False)
class FittableScene:
    """A target and the scene that is to look like it.

    **Fields:**

    - `made_of`: what the scene is built of; `scene`: at the defaults of `parameters`,
      its own, free and held.
    """

    target: Target
    made_of: SceneFromImagery
    settings: FitSettings
    parameters: list[Parameter]
    scene: Scene

    @classmethod
    def of(
        cls,
        target: Target,
        settings: FitSettings,
        analysis: Analysis | None = None,
        overrides: Mapping[str, Mapping] | None = None,
        classes: Mapping[str, CloudClass] | None = None,
    ) -> "FittableScene":
        """Build the scene of a target.

        **Arguments:** as of `cloudjax_fit.fit`.

        **Raises:** `ValueError` for an override that does not exist or contradicts
        itself.
        """
        made_of = settings.scene_from(target.imagery, analysis, classes)
        parameters = with_overrides(scene_parameters(made_of), overrides or {})
        defaults = jnp.asarray([p.default for p in parameters])
        scene = put_all(made_of.build(), parameters, defaults)
        return cls(target, made_of, settings, parameters, scene)

    @property
    def name(self) -> str:
        """Give what the scene is called."""
        return self.target.imagery.name

    @property
    def free(self) -> list[Parameter]:
        """Give the parameters that a fit may move."""
        return [p for p in self.parameters if p.free]

    def pose(self, rays: int | None = None) -> Problem:
        """Choose rays, by default as many as the settings say, and look along them."""
        settings = self.settings
        problem, _ = pose(
            self.target,
            self.scene,
            self.free,
            rays=settings.rays if rays is None else rays,
            seed=settings.seed,
            texture=settings.statistics == TEXTURE,
        )
        return problem

    def with_values(self, values: Mapping[str, float]) -> Scene:
        """Return the scene with other values of some parameters, by their names."""
        changed = [p for p in self.parameters if p.name in values]
        numbers = jnp.asarray([values[p.name] for p in changed])
        return put_all(self.scene, changed, numbers)

    def result(
        self,
        best: Solution,
        status: str,
        estimates: Sequence[Estimate],
        undetermined: Sequence[str],
        phases: Phases,
    ) -> FitResult:
        """Render the scene before and after a fit, and say what the fit found.

        **Arguments:** `estimates`: of the free parameters, in their order.
        """
        fitted = self.with_values({e.parameter.name: e.value for e in estimates})
        start = simulate_image(self.scene, self.made_of)
        image = simulate_image(fitted, self.made_of)
        phases.lap("render")
        depths = dict(
            zip((one.name for one in fitted.layers), image.depths, strict=True)
        )
        said = cautions(self.target, estimates, depths, image.on_earth)
        return FitResult(
            target=self.target,
            made_of=self.made_of,
            settings=self.settings,
            converged=best.converged and not best.interrupted,
            status=status,
            scene=fitted,
            estimates=list(estimates),
            held=[p for p in self.parameters if not p.free],
            undetermined=list(undetermined),
            start=start,
            image=image,
            distances_start=self.target.distances(start),
            distances_fit=self.target.distances(image),
            history=best.history,
            seconds=phases.seconds,
            warnings=[*said, *self.made_of.notes],
            interrupted=best.interrupted,
        )
