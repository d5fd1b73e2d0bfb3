"""`cloudjax render`."""

import os
from pathlib import Path

import click

from .column_clouds import column_options
from .options import (
    Place,
    Time,
    bands_option,
    classes_option,
    dask_option,
    decision_option,
    ignore_weather_option,
    refuse,
    resolution_option,
    resume_option,
)
from .quality_options import AskedQuality, quality_options
from .runners import Here
from .sensor_render import CLOUD_OPTIONS, render_over


_OF_SCENES = ("parameters", "ignore_weather", "resume")
_OF_SENSORS = (
    "time",
    "longitude",
    "centre",
    "place",
    "decision",
    "detail",
    "animation",
)


@click.command()
@click.argument("targets", nargs=-1, required=True, metavar="SCENE...|SENSOR")
@click.option("-o", "--output", required=True, metavar="OUT.nc|DIR")
@bands_option
@quality_options
@resolution_option
@click.option("--seed", type=int, help="Of the clouds.")
@click.option(
    "--light",
    help="physical or paper; a file of --parameters says its own.  [default: physical]",
)
@click.option(
    "--quantity",
    "quantities",
    type=click.Choice(["radiance", "reflectance", "brightness-temperature", "all"]),
    multiple=True,
    default=["radiance"],
    help="Of the file's variables; again for more.  [default: radiance]",
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
@column_options
@click.option(
    "--detail",
    type=float,
    metavar="METRES",
    help="Sensor: fractal detail in clouds of a model or a retrieval, down to waves "
    "of so many metres.  [default: none]",
)
@click.option("--time", type=Time(), help="Sensor: UTC.  [default: of the clouds]")
@click.option("--frames", type=click.IntRange(1), default=1, help="Sensor: images.")
@click.option(
    "--minutes",
    type=click.FloatRange(0, min_open=True),
    default=30.0,
    help="Sensor: between frames.",
)
@click.option(
    "--animation",
    type=click.Choice(["webp", "gif", "mp4"]),
    help="Sensor: also a film of the frames, OUT.webp and so on; mp4 needs ffmpeg.",
)
@classes_option
@click.option("--longitude", type=float, help="Sensor: of an ABI's satellite.")
@click.option("--centre", type=Place(), help="Sensor: of a mesoscale sector.")
@dask_option
@resume_option
def render(targets, output, bands, runner, **options) -> int | None:
    """Simulate the radiances of a scene, or of a sensor over weather.

    A SCENE is a folder: where clouds may stand and what is below them comes from its
    files. A SENSOR is a name such as abi-fulldisk-10km, abi-conus-2km or abi-meso-1km,
    or a TOML file; clouds come from --weather, with winds and ground, from --wrf, from
    --retrieval, or from --particles.

    Writes OUT.nc (CF) and a picture, OUT.png, beside it; of several frames OUT-000.nc
    and so on, and with --animation a film of them; of several scenes, or with --dask,
    NAME.nc each to DIR, beside a summary of all.
    """
    several = len(targets) > 1 or runner is not None
    folders = [target for target in targets if Path(target).is_dir()]
    if not folders and not several:
        refuse(_OF_SCENES, options, f"{targets[0]} is no folder of a scene")
        _render_sensor(targets[0], _writable(output), bands, options)
        return None
    for target in targets:
        for name in (name for name in CLOUD_OPTIONS if options[name]):
            raise click.UsageError(
                f"{target} is a scene, whose weather is in its folder: leave out "
                f"--{name}"
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


def _render_sensor(sensor: str, path: Path, bands, options) -> None:
    from cloudjax_data.output_lock import alone

    with alone(path.parent, path.name):
        render_over(sensor, path, bands, options)


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
    names = "classes", "parameters", "ignore_weather", "quantities", "resume"
    given = {name: options[name] for name in names}
    return given | {"options": of_fit, "quality": AskedQuality.of(options)}
