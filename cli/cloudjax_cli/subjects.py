"""What is timed on this machine: the scene of a folder, or a sensor over weather."""

from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

import click

from cloudjax import Scene
from cloudjax_data import open_wrf, read_wrf, sun_direction
from cloudjax_fit.fit_inputs import FitInputs, read_inputs
from cloudjax_fit.fitted_image import fitted_scene, fitted_values
from cloudjax_fit.parameter_file import read_parameters
from cloudjax_scenes.model_scene import ModelWorld
from cloudjax_scenes.quality import Quality
from cloudjax_scenes.sensors import read_sensor
from cloudjax_scenes.trade.subjects import imagery_outline, sensor_subject, some_of
from cloudjax_scenes.trade.trial import Subject
from cloudjax_scenes.weather_scene import World, open_world


def subject_of(
    target: str,
    *,
    bands: Sequence[int] | None,
    light: str | None,
    ignore_weather: bool = False,
    parameters: str | None = None,
    weather: Sequence[str] = (),
    wrf: Sequence[str] = (),
    place: tuple[float, float] | None = None,
    time: datetime | None = None,
    centre: tuple[float, float] | None = None,
    shadows: int = 0,
) -> Subject:
    """Read what `cloudjax render` would, and draw some of its pixels.

    **Raises:** `click.UsageError` for options of a sensor where the target is a folder,
    and the other way round.
    """
    if Path(target).is_dir():
        if weather or wrf or place or time or centre:
            raise click.UsageError(
                f"{target} is a scene, which has a place, time and weather of its "
                "own: leave out --weather, --wrf, --place, --time and --centre"
            )
        inputs = read_inputs(
            target,
            bands=bands,
            options={"light": light},
            fitted=None if parameters is None else read_parameters(parameters),
            ignore_weather=ignore_weather,
        )
        return folder_subject(target, inputs, shadows)
    if parameters is not None or ignore_weather:
        raise click.UsageError(
            f"{target} is no folder of a scene: leave out --parameters and "
            "--ignore-weather"
        )
    if bool(weather) == bool(wrf):
        raise click.UsageError(
            f"{target} is no folder of a scene; a sensor needs clouds: give --weather "
            "GFS.grib2 or --wrf WRFOUT"
        )
    settings: dict[str, Any] = {} if light is None else {"light": light}
    settings["shadows"] = shadows
    world, moment = _world(weather, wrf, place, time, settings)
    return sensor_subject(world, read_sensor(target, centre=centre), bands, moment)


def _world(
    weather, wrf, place, time, settings: dict[str, Any]
) -> tuple[World | ModelWorld, datetime]:
    """Clouds over an analysis, or those of a model, and the time asked or theirs."""
    if wrf:
        frame = open_wrf(wrf).at(time)
        return ModelWorld(read_wrf(frame, place), **settings), frame.time
    world = open_world(weather, None, **settings)
    return world, time or world.series.times[0]


def folder_subject(name: str, inputs: FitInputs, shadows: int) -> Subject:
    """Make a subject of a scene folder, at fitted parameters or the defaults."""
    values = fitted_values(inputs)
    whole = fitted_scene(inputs, values, shadows=shadows)
    imagery, light = inputs.made_of.imagery, inputs.made_of.light

    def scene(quality: Quality) -> Scene:
        shaded = replace(whole, shadows=light.shadows(quality.shadows))
        return quality.of_scene(shaded)

    rays, _ = imagery.on_earth()
    return Subject(
        name=name,
        outline=imagery_outline(imagery, light, shadows, rays),
        scene=scene,
        rays=some_of(rays),
        sun_direction=sun_direction(imagery.time),
    )
