"""Subjects of trials: a sensor over weather."""

from collections.abc import Sequence
from datetime import datetime
from typing import Any

import numpy as np

from cloudjax import Band, Rays, Scene
from cloudjax_data import sun_direction
from cloudjax_scenes.lights import light_of
from cloudjax_scenes.model_scene import ModelWorld
from cloudjax_scenes.quality import Quality
from cloudjax_scenes.sensor_image import is_day
from cloudjax_scenes.sensors import Sensor
from cloudjax_scenes.weather_scene import World

from .trial import Subject


# Pixels that are timed: a tile that every machine's cache holds.
PIXELS = 2048
_SEED = 0
# To tell by what light a sensor sees.
_LOOKED_AT = 10_000


def some_of(rays: Rays, count: int = PIXELS) -> Rays:
    """Draw some rays at random, the same each time."""
    few = np.random.default_rng(_SEED).permutation(len(rays))[:count]
    return rays[np.sort(few)]


def kind_of(source: str, scene: Scene) -> str:
    """Name the kind of a scene: where its clouds are from, its light, what is seen."""
    parts = scene.reflective, scene.emissive, scene.shadows
    seen = [part is not None for part in parts]
    return _kind(source, light_of(scene).name, *seen)


def _kind(source: str, light: str, sunlit: bool, thermal: bool, shaded: bool) -> str:
    named = (sunlit, "sunlit"), (thermal, "thermal"), (shaded and sunlit, "shaded")
    return (
        f"{source} in {light} light, {' '.join(name for is_so, name in named if is_so)}"
    )


def kind_and_pixels(
    world: World | ModelWorld, sensor: Sensor, bands: Sequence[Band], time: datetime
) -> tuple[str, int]:
    """Tell the kind of a scene not built yet, and how many pixels see the Earth.

    By some of the pixels, evenly far apart.
    """
    view, sun = sensor.view, sun_direction(time)
    every = int(np.prod(view.shape))
    some = np.unique(np.linspace(0, every - 1, min(every, _LOOKED_AT)).astype(int))
    ground, hit = view.rays(some).ground()
    day = is_day(ground, hit, sun)
    kind = _kind(
        _source(world),
        world.light,
        any(band.reflective or (day and band.sunlit) for band in bands),
        any(not band.reflective for band in bands),
        world.shadows > 0,
    )
    return kind, max(round(every * float(hit.mean())), 1)


def _source(world: World | ModelWorld) -> str:
    return "weather" if isinstance(world, World) else "model"


def sensor_subject(
    world: World | ModelWorld,
    sensor: Sensor,
    bands: Sequence[int] | None,
    time: datetime,
) -> Subject:
    """Make a subject of what a sensor would see of a world.

    **Arguments:** `bands`: by number; None for those of the sensor.
    """
    rays, sun = sensor.view.rays(), sun_direction(time)
    ground, hit = rays.ground()
    day, chosen = is_day(ground, hit, sun), sensor.choose(bands)
    winds: Any = world.winds(time)

    def scene(quality: Quality) -> Scene:
        return quality.of_world(world).scene(chosen, time, winds, day=day)

    rays = rays[hit] if hit.any() else rays
    return Subject(
        name=f"{sensor.name} over {', '.join(world.sources)}",
        kind=kind_of(_source(world), scene(Quality(shadows=world.shadows))),
        scene=scene,
        rays=some_of(rays),
        sun_direction=sun,
        pixels=len(rays),
    )
