"""How a fit is done."""

from collections.abc import Mapping
from dataclasses import dataclass

from cloudjax import CloudClass
from cloudjax_scenes.imagery import Imagery
from cloudjax_scenes.imagery_scene import SceneFromImagery
from cloudjax_scenes.lights import PHYSICAL, light_named
from cloudjax_scenes.weather_analysis import Analysis


# What fits compare: radiances of single pixels, or neighbours and bands together too.
VALUES, TEXTURE = STATISTICS = "values", "texture"


@dataclass(frozen=True)
class FitSettings:
    """`FitSettings` say how a fit is done.

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


# How well a fit is done, by name: what a look needs, what is usual, and what others are
# compared with (docs/accuracy/speed.md).
QUALITIES: Mapping[str, Mapping[str, int]] = {
    "draft": {"rays": 2048, "steps": 12},
    "standard": {"rays": FitSettings.rays, "steps": FitSettings.steps},
    "reference": {"rays": 16384, "steps": 48},
}
