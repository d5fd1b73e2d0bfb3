"""What is to be shown, from each source of cloud that the project has."""

from datetime import datetime

import numpy as np

from cloudjax import Scene, bands_named, sun_over
from cloudjax.geometry.column_grid import ColumnGrid
from cloudjax_data import DataError, sun_direction
from cloudjax_scenes.imagery import Imagery
from cloudjax_scenes.imagery_scene import SceneFromImagery
from cloudjax_scenes.lights import light_of
from cloudjax_scenes.model_scene import ModelWorld
from cloudjax_scenes.weather_scene import World

from .box import Box
from .sky import Sight


# Of the visible, and one beside it that stands for green.
_BANDS = (1, 2, 3)
# Azimuth and elevation [degrees].
SunPlace = tuple[float, float]


def box_about(centre: tuple[float, float], size_km: float) -> Box:
    """Make a box about latitude and longitude [degrees].

    **Raises:** `DataError` for a place or a size that is none.
    """
    return Box(*centre, size_km * 1e3)


def middle_of(grid: ColumnGrid) -> tuple[float, float]:
    """Return latitude and longitude of the middle of a model."""
    rows, columns = grid.shape
    middle = np.array([(rows - 1) / 2]), np.array([(columns - 1) / 2])
    latitude, longitude = grid.places(*middle)
    return float(latitude[0]), float(longitude[0])


def middle_of_image(imagery: Imagery) -> tuple[float, float]:
    """Return latitude and longitude of the middle of imagery."""
    places = imagery.latitude_deg, imagery.longitude_deg
    latitude, longitude = ((x.min() + x.max()) / 2 for x in places)
    return float(latitude), float(longitude)


def sight_of_weather(
    world: World, box: Box, time: datetime, sun: SunPlace | None = None
) -> Sight:
    """Show the clouds that weather lets stand in a box.

    **Arguments:** `sun`: in place of that of the time.
    """
    kind = "fractal clouds where the weather lets them stand"
    return _sight_of(world, box, time, sun, kind, [])


def sight_of_columns(
    world: ModelWorld,
    box: Box,
    time: datetime,
    whose: str,
    sun: SunPlace | None = None,
) -> Sight:
    """Show clouds in columns in a box.

    **Arguments:** `whose`: the clouds are; `sun`: in place of that of the time.
    """
    notes = world.columns.cautions()
    return _sight_of(world, box, time, sun, f"clouds in columns, {whose}", notes)


def _sight_of(
    world: World | ModelWorld, box: Box, time: datetime, sun, kind: str, notes
) -> Sight:
    return Sight(
        scene=world.scene(bands_named(*_BANDS), time),
        box=box,
        time=time,
        sun_direction=_sun(box, time, sun),
        sources=world.sources,
        notes=notes,
        kind=kind,
    )


def sight_of_imagery(
    scene: Scene, made_of: SceneFromImagery, box: Box, sun: SunPlace | None = None
) -> Sight:
    """Show the clouds of a scene from imagery in a box.

    **Arguments:**

    - `scene`: built of `made_of`, perhaps with fitted parameters.
    - `sun`: in place of that of the time.

    **Raises:** `DataError` where the scene has no band that sees the sun.
    """
    imagery = made_of.imagery
    if scene.reflective is None:
        raise DataError(
            f"{imagery.name} has no band that sees the sun, which colours clouds: give "
            "a scene of the day with band 1, 2 or 3."
        )
    return Sight(
        scene=scene,
        box=box,
        time=imagery.time,
        sun_direction=_sun(box, imagery.time, sun),
        sources=(imagery.name,),
        notes=made_of.notes,
        kind="fractal clouds where imagery has them",
        extinction_share=light_of(scene).share,
    )


def _sun(box: Box, time: datetime, sun: SunPlace | None) -> np.ndarray:
    if sun is None:
        return sun_direction(time)
    azimuth, elevation = sun
    return sun_over(
        box.latitude_deg,
        box.longitude_deg,
        zenith_deg=90 - elevation,
        azimuth_deg=azimuth,
    )
