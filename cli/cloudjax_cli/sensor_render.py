"""A sensor over weather, over a model's clouds or over retrieved ones, into files."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import click

from .column_clouds import COLUMN_OPTIONS, ColumnOption
from .options import frame_file, refuse
from .quality_options import AskedQuality


# Of which a sensor needs one.
CLOUD_OPTIONS = ("weather", *(option.name for option in COLUMN_OPTIONS))
EACH_CLOUD_OPTION = " or ".join(f"--{name}" for name in CLOUD_OPTIONS)


def render_over(
    sensor: str, path: Path, bands: Sequence[int] | None, options: Mapping[str, Any]
) -> None:
    """Render a sensor over weather, frame by frame, or over clouds in columns.

    **Arguments:** `options`: of `cloudjax render`, by name.
    """
    from cloudjax_scenes.band_image import chosen_quantities
    from cloudjax_scenes.sensors import read_sensor

    view = read_sensor(
        sensor,
        subsatellite_longitude_deg=options["longitude"],
        centre=options["centre"],
    )
    chosen = view.choose(bands)
    quantities = chosen_quantities(options["quantities"], chosen)
    _require_film(options)
    given = [name for name in CLOUD_OPTIONS if options[name]]
    if not given:
        raise click.UsageError(f"{sensor} needs clouds: give {EACH_CLOUD_OPTION}")
    if len(given) > 1:
        raise click.UsageError(f"clouds come from {EACH_CLOUD_OPTION}: give one")
    for option in COLUMN_OPTIONS:
        if option.name in given:
            _refuse_of_columns(option, options)
            columns = option.columns(options)
            _render_columns(*columns, view, chosen, path, options, quantities)
            return
    refuse(("place",), options, "the place of an ideal run is for --wrf")
    refuse(("detail",), options, "clouds of weather have detail of their own")
    world = _world(options["weather"], options)
    _render_frames(world, view, chosen, path, options, quantities)


def _refuse_of_columns(option: ColumnOption, options: Mapping[str, Any]) -> None:
    if options["frames"] > 1:
        raise click.UsageError(f"--{option.name} gives one image: leave out --frames")
    if options["detail"] is None:
        nothing = f"clouds of --{option.name} are {option.whose}, none is drawn"
        refuse(("seed",), options, f"{nothing} without --detail")


def _require_film(options) -> None:
    """End before any work where a film cannot be written."""
    if options["animation"] is None:
        return
    from cloudjax_scenes.film import FORMATS

    if options["frames"] == 1:
        raise click.UsageError("one image is no film: give --frames, such as 12")
    FORMATS[options["animation"]].require()


def _render_columns(
    columns, time: datetime, view, chosen, path: Path, options, quantities
) -> None:
    from cloudjax_scenes.image_strips import render_strips, write_strips
    from cloudjax_scenes.model_scene import ModelWorld
    from cloudjax_scenes.trade.stopwatch import Stopwatch

    from .progress import tile_progress

    names = {"light": "light", "detail": "detail_m", "seed": "seed"}
    asked = {field: options[name] for name, field in names.items()}
    known = {field: value for field, value in asked.items() if value is not None}
    world = ModelWorld(columns, **known)
    world, choice = _with_quality(world, view, chosen, time, options)
    for caution in columns.cautions():
        click.echo(caution)
    watch = Stopwatch()
    with tile_progress(path.name) as on_tile:
        images = render_strips(world, view, chosen, time, on_tile=on_tile)
        write_strips(path, watch.each(images), world, quantities)
    click.echo(f"{path} and {path.with_suffix('.png')}")
    if choice is not None:
        choice.tell(watch)


def _world(weather, options):
    from cloudjax_scenes.weather_scene import open_world

    names = ("decision", "seed", "light")
    given = {name: options[name] for name in names}
    return open_world(
        weather,
        options["classes"],
        **{name: value for name, value in given.items() if value is not None},
    )


def _with_quality(world, view, chosen, time, options) -> tuple[Any, Any]:
    """The world as it is asked to be rendered, and the choice that told, if one did."""
    from cloudjax_scenes.quality import STANDARD
    from cloudjax_scenes.trade.subjects import world_outline

    asked = AskedQuality.of(options)
    if not asked.by_front:
        return asked.by_hand(STANDARD).of_world(world), None
    shaded = replace(world, shadows=asked.shadows)
    choice = asked.by_measure(world_outline(shaded, view, chosen, time))
    return choice.quality.of_world(world), choice


def _render_frames(world, view, chosen, path, options, quantities) -> None:
    from cloudjax_scenes.film import write_film
    from cloudjax_scenes.image_strips import render_strips, write_strips
    from cloudjax_scenes.trade.stopwatch import Stopwatch

    from .progress import tile_progress

    frames = options["frames"]
    start = options["time"] or world.series.times[0]
    require_near(start, world)
    require_near(start + timedelta(minutes=(frames - 1) * options["minutes"]), world)
    world, choice = _with_quality(world, view, chosen, start, options)
    film = []
    for i, (time, air) in enumerate(world.frames(start, frames, options["minutes"])):
        file = frame_file(path, i, frames)
        watch = Stopwatch()
        with tile_progress(file.name) as on_tile:
            images = render_strips(world, view, chosen, time, air, on_tile=on_tile)
            film.append(write_strips(file, watch.each(images), world, quantities))
        click.echo(f"{file} and {file.with_suffix('.png')}")
        if choice is not None:
            choice.tell(watch)
    if options["animation"] is not None:
        file = path.with_suffix(f".{options['animation']}")
        write_film(file, film)
        click.echo(file)


def require_near(time: datetime, world) -> None:
    """Raise `DataError` for a frame hours before or after all weather."""
    from cloudjax_data import DataError

    first, last = world.series.times[0], world.series.times[-1]
    slack = timedelta(hours=3)
    if not first - slack <= time <= last + slack:
        said = "%Y-%m-%d %H:%M"
        raise DataError(
            f"{world.series.cubes[0].path} and what else is given are of "
            f"{first.strftime(said)} to {last.strftime(said)} UTC, hours from "
            f"{time.strftime(said)}: give the analyses around that time."
        )
