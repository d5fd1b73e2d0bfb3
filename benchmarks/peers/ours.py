"""cloudjax: the same picture through its public functions, footprints averaged.

`render` does everything at once. To tell what is done once for a view from what every
change of the clouds costs, `Marching` does the same in parts.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import equinox as eqx
import jax
import numpy as np

from cloudjax import (
    BandRadiances,
    Rays,
    Scene,
    Shell,
    Weather,
    navigate,
    radiances,
    sample,
)
from cloudjax.footprint import Kind, kind_of, kinds

from .problem import SUN, Problem, dark


NAME = "cloudjax"
TILE = 2048
AT_ONCE = 1 << 18

_sample, _radiances = eqx.filter_jit(sample), eqx.filter_jit(radiances)


@dataclass(frozen=True, eq=False)
class Sight:
    """What is looked at, but for the scene.

    **Fields:** `rays`: makes them. `behind`: what rays of given numbers see without
    cloud. `voxels`: per axis of the textures.
    """

    rays: Callable[[], Rays]
    sun: np.ndarray
    weather: Weather
    voxels: int
    behind: Callable[[np.ndarray], BandRadiances]


class Marching:
    """Several scenes of the same clouds on one view, kind of footprint by kind.

    Everything that is not marching depends on no parameter of the clouds, and is done
    once for all scenes. Textures of a kind are dropped after it, as `render` does.
    """

    def __init__(self, sight: Sight, scenes: Mapping[str, Scene]):
        self._sight, self._scenes = sight, scenes
        self._compiled: set = set()
        self._compile_seconds = dict.fromkeys(scenes, 0.0)

    def run(self) -> dict:
        """Seconds of each part and of the march of each scene, and its picture."""
        laps, sight = Laps(), self._sight
        rays = sight.rays()
        scene = next(iter(self._scenes.values()))
        shells = [layer.cloud.shell for layer in scene.layers]
        air = Shell(min(s.bottom_m for s in shells), max(s.top_m for s in shells))
        march = dict.fromkeys(self._scenes, 0.0)
        images = {
            name: np.empty((_bands_of(one), len(rays)), np.float32)
            for name, one in self._scenes.items()
        }
        laps.next("rays")
        for kind, members in _kinds(rays, air, laps):
            textures = tuple(
                layer.cloud.make_textures(kind.footprint, sight.voxels)
                for layer in scene.layers
            )
            jax.block_until_ready(textures)
            laps.next("textures")
            tiles = [
                (self._view(scene, kind, rays, filled), textures, index)
                for index, filled in _tiles(members, min(TILE, len(rays)))
            ]
            laps.next("navigation")
            for name, one in self._scenes.items():
                self._compile(name, one, tiles[0], (kind.knots, kind.twice))
                march[name] += self._march(one, tiles, images[name])
            laps.skip()
        return {
            "view": laps.seconds,
            "march": march,
            "compile": self._compile_seconds,
            "images": images,
        }

    def _view(self, scene: Scene, kind: Kind, rays: Rays, index):
        view = navigate(
            scene,
            rays[index],
            self._sight.sun,
            self._sight.weather.masks,
            knots=kind.knots,
            twice=kind.twice,
        )
        return jax.block_until_ready((view, self._sight.behind(index)))

    def _compile(self, name: str, scene: Scene, tile, shape) -> None:
        if (name, shape) not in self._compiled:
            self._compiled.add((name, shape))
            self._compile_seconds[name] += self._march(scene, [tile], None)

    def _march(self, scene: Scene, tiles, image) -> float:
        """Samples and radiances: what every change of the clouds costs."""
        started = time.perf_counter()
        pending = []
        for (view, behind), textures, index in tiles:
            seen = _radiances(scene, _sample(scene, view, textures), behind)
            pending.append((index, seen))
            if len(pending) > 1:
                _store(image, *pending.pop(0))
        for item in pending:
            _store(image, *item)
        return time.perf_counter() - started


def _bands_of(scene: Scene) -> int:
    groups = (scene.reflective, scene.emissive)
    return sum(len(bands.numbers) for bands in groups if bands is not None)


def _tiles(members: np.ndarray, tile: int):
    """Numbers of the rays of each tile, also filled up to its size."""
    for start in range(0, len(members), tile):
        index = members[start : start + tile]
        last = np.full(tile - len(index), index[-1])
        yield index, np.concatenate([index, last])


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


def _store(image, index, seen: BandRadiances):
    bands = np.concatenate([np.asarray(part) for part in jax.tree.leaves(seen)])
    if image is not None:
        image[:, index] = bands[:, : len(index)]


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


def disc(problem: Problem, presets, layers: int = 1, bands: int = 1) -> Marching:
    """The full disc with several presets."""
    sight = Sight(
        lambda: problem.grid().rays(),
        SUN,
        problem.weather(layers),
        problem.voxels,
        lambda index: dark(len(index), bands),
    )
    scenes = {name_of(p): problem.scene(*p, layers, bands) for p in presets}
    return Marching(sight, scenes)


def load(problem: Problem, presets) -> dict[str, Callable]:
    """One function, which renders all presets."""
    return {"render": disc(problem, presets).run}
