"""cloudjax: the same picture through its public functions, footprints averaged."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import jax
import numpy as np

from cloudjax import Rays, Scene
from cloudjax.image.render import PreparedImage, prepare, render

from .problem import SUN, Problem


NAME = "cloudjax"


@dataclass(frozen=True, eq=False)
class Sight:
    """Where a scene is looked at from.

    **Fields:** `rays`: makes them.
    """

    rays: Callable[[], Rays]
    sun: np.ndarray


class Marching:
    """Several scenes of the same clouds on one view.

    What is prepared depends on no parameter of the clouds, and serves all scenes.
    """

    def __init__(self, sight: Sight, scenes: Mapping[str, Scene]):
        self._sight, self._scenes = sight, scenes
        self._compile_seconds: dict[str, float] = {}

    def run(self) -> dict:
        """Seconds of each part, of the march of each scene and of a picture that is
        rendered once, and the pictures.
        """
        laps, sight = Laps(), self._sight
        rays = sight.rays()
        laps.next("rays")
        prepared = prepare(
            max(self._scenes.values(), key=lambda scene: scene.layers[0].steps),
            rays,
            sight.sun,
        )
        laps.next("preparation")
        march, whole, images = {}, {}, {}
        for name, scene in self._scenes.items():
            whole[name] = _once(sight, scene)
            seconds, image = _march(prepared, scene)
            if name not in self._compile_seconds:
                cold = seconds
                seconds, image = _march(prepared, scene)
                self._compile_seconds[name] = cold - seconds
            march[name], images[name] = seconds, image
        return {
            "view": laps.seconds,
            "march": march,
            "whole": whole,
            "compile": self._compile_seconds,
            "images": images,
        }


def _once(sight: Sight, scene: Scene) -> float:
    started = time.perf_counter()
    render(scene, sight.rays(), sight.sun)
    return time.perf_counter() - started


def _march(prepared: PreparedImage, scene: Scene) -> tuple[float, np.ndarray]:
    started = time.perf_counter()
    parts = jax.tree.leaves(render(scene, prepared).radiances)
    return time.perf_counter() - started, np.concatenate(parts)


class Laps:
    """Wall time by phase, `seconds`, added up over many laps."""

    def __init__(self):
        self.seconds: dict[str, float] = {}
        self.skip()

    def skip(self) -> None:
        self._last = time.perf_counter()

    def next(self, phase: str) -> None:
        now = time.perf_counter()
        self.seconds[phase] = self.seconds.get(phase, 0.0) + now - self._last
        self._last = now


def name_of(preset: tuple[int, int]) -> str:
    steps, nodes = preset
    return f"{NAME}, {steps} steps, {nodes} node{'s' * (nodes > 1)}"


def disc(problem: Problem, presets, layers: int = 1, bands: int = 1) -> Marching:
    """The full disc with several presets."""
    sight = Sight(lambda: problem.grid().rays(), SUN)
    scenes = {name_of(p): problem.scene(*p, layers, bands) for p in presets}
    return Marching(sight, scenes)


def load(problem: Problem, presets) -> dict[str, Callable]:
    """One function, which renders all presets."""
    return {"render": disc(problem, presets).run}
