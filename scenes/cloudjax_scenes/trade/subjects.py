"""Subjects of trials: a sensor over weather."""

from collections.abc import Sequence
from datetime import datetime

import numpy as np

from cloudjax import Rays, Scene
from cloudjax_data import sun_direction
from cloudjax_scenes.lights import light_of
from cloudjax_scenes.quality import Quality
from cloudjax_scenes.sensor_image import is_day
from cloudjax_scenes.sensors import Sensor
from cloudjax_scenes.weather_scene import World

from .trial import Subject


# Pixels that are timed: a tile that every machine's cache holds.
PIXELS = 2048
_SEED = 0


def some_of(rays: Rays, count: int = PIXELS) -> Rays:
    """Draw some rays at random, the same each time."""
    few = np.random.default_rng(_SEED).permutation(len(rays))[:count]
    return rays[np.sort(few)]


def kind_of(source: str, scene: Scene) -> str:
    """Name the kind of a scene: where its clouds are from, its light, what is seen."""
    parts = (scene.reflective, "sunlit"), (scene.emissive, "thermal")
    seen = " and ".join(name for bands, name in parts if bands is not None)
    return f"{source} in {light_of(scene).name} light, {seen}"


def sensor_subject(
    world: World, sensor: Sensor, bands: Sequence[int] | None, time: datetime
) -> Subject:
    """Make a subject of what a sensor would see of a world.

    **Arguments:** `bands`: by number; None for those of the sensor.
    """
    rays, sun = sensor.view.rays(), sun_direction(time)
    ground, hit = rays.ground()
    day, chosen = is_day(ground, hit, sun), sensor.choose(bands)
    winds = world.winds(time)

    def scene(quality: Quality) -> Scene:
        return quality.of_world(world).scene(chosen, time, winds, day=day)

    rays = rays[hit] if hit.any() else rays
    return Subject(
        name=f"{sensor.name} over {', '.join(world.sources)}",
        kind=kind_of("weather", scene(Quality(shadows=world.shadows))),
        scene=scene,
        rays=some_of(rays),
        sun_direction=sun,
        pixels=len(rays),
    )
