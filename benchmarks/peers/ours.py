"""cloudjax: the same picture through its public functions, footprints averaged.

`render` does everything at once. To tell what is done once for a view from what every
change of the clouds costs, `Marching` does the same in parts.
"""

import time
from collections.abc import Callable

import equinox as eqx
import jax
import numpy as np

from cloudjax import Scene, Shell, navigate, radiances, sample
from cloudjax.footprint import kind_of, kinds

from .problem import SUN, Problem, dark


NAME = "cloudjax"
TILE = 2048
AT_ONCE = 1 << 18

_sample, _radiances = eqx.filter_jit(sample), eqx.filter_jit(radiances)


class Marching:
    """Many presets on one view, kind of footprint by kind of footprint.

    Everything that is not marching depends on no parameter of the clouds, and is done
    once for all presets. Textures of a kind are dropped after it, as `render` does.
    """

    def __init__(self, problem: Problem, presets, layers: int = 1, bands: int = 1):
        self._problem, self._layers, self._bands = problem, layers, bands
        self._scenes = {
            name_of(p): problem.scene(*p, layers=layers, bands=bands) for p in presets
        }
        self._compiled: set = set()
        self._compile_seconds = dict.fromkeys(self._scenes, 0.0)

    def run(self) -> dict:
        """Seconds of each part and of the march of each preset, and its picture."""
        laps, problem = Laps(), self._problem
        rays, weather = problem.grid().rays(), problem.weather(self._layers)
        scene = next(iter(self._scenes.values()))
        shells = [layer.cloud.shell for layer in scene.layers]
        air = Shell(min(s.bottom_m for s in shells), max(s.top_m for s in shells))
        march = dict.fromkeys(self._scenes, 0.0)
        images = {name: np.empty(len(rays), np.float32) for name in self._scenes}
        tile = min(TILE, len(rays))
        laps.next("rays")
        for kind, members in _kinds(rays, air, laps):
            textures = tuple(
                layer.cloud.make_textures(kind.footprint, problem.voxels)
                for layer in scene.layers
            )
            jax.block_until_ready(textures)
            laps.next("textures")
            tiles = []
            for start in range(0, len(members), tile):
                index = members[start : start + tile]
                last = np.full(tile - len(index), index[-1])
                filled = rays[np.concatenate([index, last])]
                more = {"knots": kind.knots, "twice": kind.twice}
                view = navigate(scene, filled, SUN, weather.masks, **more)
                tiles.append((jax.block_until_ready(view), textures, index))
            laps.next("navigation")
            for name, scene in self._scenes.items():
                self._compile(name, scene, tiles[0], (kind.knots, kind.twice))
                march[name] += self._march(name, scene, tiles, images[name])
            laps.skip()
        return {
            "view": laps.seconds,
            "march": march,
            "compile": self._compile_seconds,
            "images": images,
        }

    def _compile(self, name: str, scene: Scene, tile, shape) -> None:
        if (name, shape) in self._compiled:
            return
        self._compiled.add((name, shape))
        self._compile_seconds[name] += self._march(name, scene, [tile], None)

    def _march(self, name: str, scene: Scene, tiles, image) -> float:
        """Samples and radiances: what every change of the clouds costs."""
        started = time.perf_counter()
        behind = dark(len(tiles[0][0].start_m[0]), self._bands)
        pending = []
        for view, textures, index in tiles:
            seen = _radiances(scene, _sample(scene, view, textures), behind)
            pending.append((index, seen.reflective))
            if len(pending) > 1:
                _store(image, *pending.pop(0))
        for item in pending:
            _store(image, *item)
        return time.perf_counter() - started


def _kinds(rays, shell, laps: "Laps"):
    """Kinds of footprint with the numbers of their rays."""
    rows = np.concatenate(
        [
            kinds(rays[np.arange(i, min(i + AT_ONCE, len(rays)))], shell)
            for i in range(0, len(rays), AT_ONCE)
        ]
    )
    found, kind_of_ray = np.unique(rows, axis=0, return_inverse=True)
    order = np.argsort(kind_of_ray.reshape(-1), kind="stable")
    ends = np.cumsum(np.bincount(kind_of_ray.reshape(-1)))
    laps.next("kinds")
    for row, members in zip(found, np.split(order, ends[:-1]), strict=True):
        yield kind_of(row), members


def _store(image, index, reflective):
    seen = np.asarray(reflective[0])[: len(index)]
    if image is not None:
        image[index] = seen


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
    return f"{NAME}, {preset[0]} steps, {preset[1]} nodes"


def load(problem: Problem, presets) -> dict[str, Callable]:
    """One function, which renders all presets."""
    return {"render": Marching(problem, presets).run}
