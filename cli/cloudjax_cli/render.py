"""`cloudjax render`."""

import os
from datetime import datetime, timedelta
from pathlib import Path

import click

from .options import (
    Place,
    Time,
    bands_option,
    classes_option,
    dask_option,
    decision_option,
    ignore_weather_option,
    resolution_option,
    resume_option,
)
from .runners import Here


_OF_SCENES = ("parameters", "ignore_weather", "resume")
_OF_SENSORS = ("time", "longitude", "centre", "place", "decision")


@click.command()
@click.argument("targets", nargs=-1, required=True, metavar="SCENE...|SENSOR")
@click.option("-o", "--output", required=True, metavar="OUT.nc|DIR")
@bands_option
@click.option("--steps", type=int, help="Through each cloud shell.")
@resolution_option
@click.option("--seed", type=int, help="Of the clouds.")
@click.option(
    "--light",
    help="physical or paper.  [default: paper for a scene, physical for a sensor]",
)
@click.option(
    "--quantity",
    "quantities",
    type=click.Choice(["radiance", "reflectance", "brightness-temperature", "all"]),
    multiple=True,
    default=["radiance"],
    help="Of the file's variables; again for more.  [default: radiance]",
)
@click.option(
    "--shadows",
    type=click.IntRange(0),
    default=0,
    help="Steps towards the sun, with physical light; 6 are good, 0 is none.",
)
@click.option("--parameters", metavar="FILE", help="Scene: parameters.toml of a fit.")
@ignore_weather_option
@click.option(
    "--weather",
    multiple=True,
    metavar="GRIB",
    help="Sensor: a global analysis; again for those of other times.",
)
@decision_option
@click.option(
    "--wrf",
    multiple=True,
    metavar="WRFOUT",
    help="Sensor: a weather model's own clouds; again for more files of the run.",
)
@click.option("--place", type=Place(), help="Sensor: centre of an ideal WRF run.")
@click.option("--time", type=Time(), help="Sensor: UTC.  [default: of the weather]")
@click.option("--frames", type=click.IntRange(1), default=1, help="Sensor: images.")
@click.option(
    "--minutes",
    type=click.FloatRange(0, min_open=True),
    default=30.0,
    help="Sensor: between frames.",
)
@classes_option
@click.option("--longitude", type=float, help="Sensor: of an ABI's satellite.")
@click.option("--centre", type=Place(), help="Sensor: of a mesoscale sector.")
@dask_option
@resume_option
def render(targets, output, bands, weather, wrf, runner, **options) -> int | None:
    """Simulate the radiances of a scene, or of a sensor over weather.

    A SCENE is a folder: where clouds may stand and what is below them comes from its
    files. A SENSOR is a name such as abi-fulldisk-10km, abi-conus-2km or abi-meso-1km,
    or a TOML file; clouds, winds and ground come from --weather, or from --wrf.

    Writes OUT.nc (CF) and a picture, OUT.png, beside it; of several frames OUT-000.nc
    and so on; of several scenes, or with --dask, NAME.nc each to DIR, beside a summary
    of all.
    """
    several = len(targets) > 1 or runner is not None
    folders = [target for target in targets if Path(target).is_dir()]
    if not folders and not several:
        _render_sensor(targets[0], _writable(output), bands, weather, wrf, options)
        return None
    for target in targets:
        if weather or wrf:
            raise click.UsageError(
                f"{target} is a scene, whose weather is in its folder: leave out "
                f"--{'weather' if weather else 'wrf'}"
            )
        refuse(_OF_SENSORS, options, f"{target} is a scene")
    if several:
        return _render_scenes(targets, output, bands, runner, options)
    return _render_scene(targets[0], _writable(output), bands, options)


def _writable(output: str) -> Path:
    from cloudjax_data.whole_files import require_plain, require_writable

    require_plain(output)
    path = Path(output)
    if path.suffix != ".nc":
        raise click.UsageError(f"the output is a netCDF file, and {output} is not *.nc")
    require_writable(path.parent)
    return path


def refuse(names, options, because: str) -> None:
    """End with a sentence if one of these options has been given."""
    for name in names:
        # Not "if options[name]": a longitude may be 0.
        if options[name] is not None and options[name] is not False:
            option = name.replace("_", "-")
            raise click.UsageError(f"{because}: leave out --{option}")


def _render_scene(scene: str, path: Path, bands, options) -> None:
    from .scene_render import SceneRender

    task = SceneRender(scene, str(path), bands, **_of_a_scene(options))
    task.check()
    task()
    click.echo(f"{path} and {path.with_suffix('.png')}")


def _render_scenes(scenes, output: str, bands, runner, options) -> int:
    from cloudjax_data.whole_files import require_writable

    from .many_scenes import run_scenes
    from .scene_render import SceneRender
    from .scene_tasks import distinct_names

    if Path(output).suffix == ".nc":
        raise click.UsageError(
            f"several images need a folder, and {output} is named like one of them"
        )
    require_writable(output)
    # Workers elsewhere have other working folders.
    located = os.path.abspath if runner else str
    given = _of_a_scene(options)
    for file in ("classes", "parameters"):
        given[file] = given[file] and located(given[file])
    tasks = [
        SceneRender(
            located(scene), located(os.path.join(output, f"{name}.nc")), bands, **given
        )
        for scene, name in zip(scenes, distinct_names(scenes), strict=True)
    ]
    return run_scenes(tasks, runner or Here(), Path(output), "Images of scenes")


def _of_a_scene(options) -> dict:
    """What `SceneRender` asks for, by name, once it has been checked."""
    from cloudjax_fit.parameter_file import read_parameters
    from cloudjax_fit.settings import Settings, with_options

    of_fit = {name: options[name] for name in ("steps", "seed", "light")}
    with_options(Settings(), of_fit)
    if options["parameters"] is not None:
        read_parameters(options["parameters"])
    names = "classes", "parameters", "ignore_weather", "shadows", "quantities", "resume"
    return {"options": of_fit} | {name: options[name] for name in names}


def _render_sensor(sensor: str, path: Path, bands, weather, wrf, options) -> None:
    from cloudjax_scenes.band_image import chosen_quantities
    from cloudjax_scenes.sensors import read_sensor

    refuse(_OF_SCENES, options, f"{sensor} is no folder of a scene")
    view = read_sensor(
        sensor,
        subsatellite_longitude_deg=options["longitude"],
        centre=options["centre"],
    )
    chosen = view.choose(bands)
    quantities = chosen_quantities(options["quantities"], chosen)
    if wrf:
        if weather:
            raise click.UsageError("clouds come from --weather or --wrf: give one")
        _render_model(wrf, view, chosen, path, options, quantities)
        return
    if not weather:
        raise click.UsageError(
            f"{sensor} needs clouds: give --weather GFS.grib2 or --wrf WRFOUT"
        )
    refuse(("place",), options, "the place of an ideal run is for --wrf")
    world = _world(weather, options)
    _render_frames(world, view, chosen, path, options, quantities)


def _render_model(wrf, view, chosen, path: Path, options, quantities) -> None:
    from cloudjax_data import open_wrf, read_wrf
    from cloudjax_scenes.image_strips import render_strips, write_strips
    from cloudjax_scenes.model_scene import ModelWorld

    from .progress import tile_progress

    own = "clouds of --wrf are the model's own"
    refuse(("seed", "classes", "decision"), options, own)
    if options["frames"] > 1:
        raise click.UsageError("--wrf gives one image: leave out --frames")
    frame = open_wrf(wrf).at(options["time"])
    columns = read_wrf(frame, options["place"])
    given = {name: options[name] for name in ("steps", "light", "shadows")}
    world = ModelWorld(
        columns, **{name: value for name, value in given.items() if value is not None}
    )
    for caution in columns.cautions():
        click.echo(caution)
    with tile_progress(path.name) as on_tile:
        images = render_strips(world, view, chosen, frame.time, on_tile=on_tile)
        write_strips(path, images, world, quantities)
    click.echo(f"{path} and {path.with_suffix('.png')}")


def _world(weather, options):
    from cloudjax_scenes.weather_scene import open_world

    names = ("decision", "seed", "steps", "light", "shadows")
    given = {name: options[name] for name in names}
    return open_world(
        weather,
        options["classes"],
        **{name: value for name, value in given.items() if value is not None},
    )


def _render_frames(world, view, chosen, path, options, quantities) -> None:
    from cloudjax_scenes.image_strips import render_strips, write_strips

    from .progress import tile_progress

    frames = options["frames"]
    start = options["time"] or world.series.times[0]
    require_near(start, world)
    require_near(start + timedelta(minutes=(frames - 1) * options["minutes"]), world)
    for i, (time, air) in enumerate(world.frames(start, frames, options["minutes"])):
        file = path if frames == 1 else path.with_stem(f"{path.stem}-{i:03d}")
        with tile_progress(file.name) as on_tile:
            images = render_strips(world, view, chosen, time, air, on_tile=on_tile)
            write_strips(file, images, world, quantities)
        click.echo(f"{file} and {file.with_suffix('.png')}")


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
