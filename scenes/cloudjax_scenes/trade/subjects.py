"""Subjects of trials: a sensor over clouds, or a scene from imagery."""

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
from cloudjax_scenes.sensor_image import is_day, rendered_pixels
from cloudjax_scenes.sensors import Sensor
from cloudjax_scenes.weather_scene import World

from .outline import Kind, Outline, kind_of, usual_pixel_m
from .trial import Subject


# Pixels of an image that are rendered: enough for cores to share, and for what is read
# alike to fill tiles.
PIXELS = 32768
_SEED = 0


def some_of(rays: Rays, count: int = PIXELS) -> Rays:
    """Draw some rays at random, the same each time, in their order."""
    few = np.random.default_rng(_SEED).permutation(len(rays))[:count]
    return rays[np.sort(few)]


def imagery_outline(
    imagery: Imagery, light: Light, shadows: int, rays: Rays
) -> Outline:
    """Outline a scene from imagery.

    **Arguments:** `rays`: that see the Earth; `shadows`: steps.
    """
    bands = tuple(imagery.bands.values())
    day = bool(imagery.sunlit)
    kind = kind_of("imagery", light.name, bands, day=day, shadows=shadows)
    numbers = tuple(band.number for band in bands)
    return Outline(kind, numbers, usual_pixel_m(some_of(rays)), len(rays))


def world_outline(
    world: World | ModelWorld, sensor: Sensor, bands: Sequence[Band], time: datetime
) -> Outline:
    """Outline what a sensor would see of a world, by some of its pixels."""
    return _outlined(world, sensor, bands, time)[0]


def sensor_subject(
    world: World | ModelWorld,
    sensor: Sensor,
    bands: Sequence[int] | None,
    time: datetime,
) -> Subject:
    """Make a subject of what a sensor would see of a world.

    **Arguments:** `bands`: by number; None for those of the sensor.
    """
    chosen = sensor.choose(bands)
    outline, rays, day = _outlined(world, sensor, chosen, time)
    winds: Any = world.winds(time)

    def scene(quality: Quality) -> Scene:
        return quality.of_world(world).scene(chosen, time, winds, day=day)

    return Subject(
        name=f"{sensor.name} over {', '.join(world.sources)}",
        outline=outline,
        scene=scene,
        rays=some_of(rays),
        sun_direction=sun_direction(time),
    )


# Of the pixels of a disc a fifth sees space.
_LOOKED_AT = PIXELS * 2


def _outlined(
    world: World | ModelWorld, sensor: Sensor, bands: Sequence[Band], time: datetime
) -> tuple[Outline, Rays, bool]:
    """The outline, some of the rays that are rendered, and whether it is day there.

    Never all rays: those of a disc of 500 m take 20 GB.
    """
    view = sensor.view
    every = int(np.prod(view.shape))
    drawn = np.random.default_rng(_SEED).choice(
        every, min(every, _LOOKED_AT), replace=False, shuffle=False
    )
    rays = view.rays(np.sort(drawn))
    ground, hit = rays.ground()
    day = is_day(ground, hit, sun_direction(time))
    pixels = rendered_pixels(view, hit)
    rays = rays[pixels]
    outline = Outline(
        _world_kind(world, bands, day=day),
        tuple(band.number for band in bands),
        usual_pixel_m(rays),
        round(every * len(pixels) / len(hit)),
    )
    return outline, rays, day


def _world_kind(world: World | ModelWorld, bands: Sequence[Band], *, day: bool) -> Kind:
    source = "weather" if isinstance(world, World) else "model"
    return kind_of(source, world.light, bands, day=day, shadows=world.shadows)
