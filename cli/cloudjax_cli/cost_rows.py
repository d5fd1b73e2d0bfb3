"""What the parts of a scene's model cost, in words."""

from collections.abc import Iterator, Sequence
from datetime import datetime
from pathlib import Path

import click

from cloudjax_data import sun_direction
from cloudjax_fit.fit_inputs import read_inputs
from cloudjax_fit.fitted_image import fitted_scene, fitted_values
from cloudjax_scenes.scene_cost import Cost, Part, costs, some_of
from cloudjax_scenes.sensors import read_sensor


Row = tuple[str, str]


def cost_rows(
    target: str,
    *,
    bands: Sequence[int] | None,
    weather: Sequence[str],
    time: datetime | None,
    centre: tuple[float, float] | None,
    ignore_weather: bool,
    light: str | None,
    shadows: int,
    budget_s: float,
) -> Iterator[Row]:
    """Tell of each part of the model whether it is used, why, and what it costs."""
    if Path(target).is_dir():
        if weather or time or centre:
            raise click.UsageError(
                f"{target} is a scene, which has a place, time and weather of its "
                "own: leave out --weather, --time and --centre"
            )
        scene, rays, sun = _of_folder(target, bands, ignore_weather, light, shadows)
    else:
        if not weather:
            raise click.UsageError(
                f"{target} is no folder of a scene; a sensor needs clouds: give "
                "--weather GFS.grib2"
            )
        scene, rays, sun = _of_sensor(
            read_sensor(target, centre=centre), bands, weather, time, light, shadows
        )
    found = costs(scene, some_of(rays), sun, pixels=len(rays), budget_s=budget_s)
    for part, cost in found:
        yield part.name, f"{_said(part, cost)}: {part.why}"


def _said(part: Part, cost: Cost) -> str:
    if not part.used:
        return "left out, costs nothing"
    if cost.seconds is None:
        return (
            "used" if part.without is None else "used, not measured in the time given"
        )
    return f"{cost.seconds:.2f} s" if cost.timed else f"about {cost.seconds:.1f} s"


def _of_folder(target, bands, ignore_weather, light, shadows):
    inputs = read_inputs(
        target, bands=bands, options={"light": light}, ignore_weather=ignore_weather
    )
    scene = fitted_scene(inputs, fitted_values(inputs), shadows=shadows)
    imagery = inputs.made_of.imagery
    rays = imagery.grid.rays()
    _, hit = rays.ground(imagery.grid.ellipsoid)
    return scene, rays[hit], sun_direction(imagery.time)


def _of_sensor(sensor, bands, weather, time, light, shadows):
    from cloudjax_scenes.sensor_image import is_day
    from cloudjax_scenes.weather_scene import open_world

    given = {} if light is None else {"light": light}
    world = open_world(weather, None, shadows=shadows, **given)
    moment = time or world.series.times[0]
    rays, sun = sensor.view.rays(), sun_direction(moment)
    ground, hit = rays.ground()
    scene = world.scene(sensor.choose(bands), moment, day=is_day(ground, hit, sun))
    return scene, rays[hit] if hit.any() else rays, sun
