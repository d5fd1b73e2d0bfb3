"""Subjects of trials, and the kinds of scenes that a front serves."""

from collections.abc import Sequence
from datetime import datetime
from typing import Any

import numpy as np

from cloudjax import Band, Rays, Scene
from cloudjax_data import sun_direction
from cloudjax_scenes.imagery import Imagery
from cloudjax_scenes.lights import Light
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


def imagery_kind(imagery: Imagery, light: Light, shadows: int) -> str:
    """Name the kind of a scene from imagery, by its light and what its bands see."""
    seen = bool(imagery.sunlit), bool(imagery.emissive), shadows > 0
    return _kind("imagery", light.name, *seen)


def _kind(source: str, light: str, sunlit: bool, thermal: bool, shaded: bool) -> str:
    named = (sunlit, "sunlit"), (thermal, "thermal"), (shaded and sunlit, "shaded")
    seen = " ".join(name for is_so, name in named if is_so)
    return f"{source} in {light} light, {seen}"


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
    kind = _world_kind(world, bands, day=is_day(ground, hit, sun))
    return kind, max(round(every * float(hit.mean())), 1)


def _world_kind(world: World | ModelWorld, bands: Sequence[Band], *, day: bool) -> str:
    return _kind(
        "weather" if isinstance(world, World) else "model",
        world.light,
        any(band.reflective or (day and band.sunlit) for band in bands),
        any(not band.reflective for band in bands),
        world.shadows > 0,
    )


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
        kind=_world_kind(world, chosen, day=day),
        scene=scene,
        rays=some_of(rays),
        sun_direction=sun,
        pixels=len(rays),
    )
