"""`cloudjax x3d`."""

from pathlib import Path

import click

from .column_clouds import COLUMN_OPTIONS, ColumnOption, column_options
from .options import (
    Place,
    Time,
    classes_option,
    decision_option,
    ignore_weather_option,
    refuse,
)
from .sensor_render import CLOUD_OPTIONS, EACH_CLOUD_OPTION, require_near


class SunPlace(Place):
    """Azimuth and elevation of the sun in degrees, such as 135,40."""

    name = "azimuth,elevation"

    def convert(self, value, param, ctx):
        azimuth, elevation = super().convert(value, param, ctx)
        # Written so that NaN fails.
        if not (abs(azimuth) <= 360 and abs(elevation) <= 90):
            self.fail(f"{value!r} is not an azimuth and an elevation such as 135,40")
        return azimuth, elevation


_OF_SCENES = ("parameters", "ignore_weather")


@click.command()
@click.argument("scene", required=False)
@click.option("-o", "--output", required=True, metavar="DIR", help="For all files.")
@click.option(
    "--weather",
    multiple=True,
    metavar="GRIB",
    help="A global analysis; again for those of other times.",
)
@decision_option
@column_options
@click.option("--parameters", metavar="FILE", help="Scene: parameters.toml of a fit.")
@ignore_weather_option
@classes_option
@click.option(
    "--time",
    "times",
    type=Time(),
    multiple=True,
    help="UTC; again for more, each in a folder of its own.  [default: of the weather]",
)
@click.option(
    "--centre", type=Place(), help="Of the box.  [default: of all but weather]"
)
@click.option("--size-km", type=float, default=50.0, help="Of the box, edge to edge.")
@click.option(
    "--boards",
    type=int,
    default=1000,
    help="At most, in each sector; one for each cloud at least.",
)
@click.option(
    "--pixels",
    type=int,
    help="Of all boards together, across the box.  [default: by the boards]",
)
@click.option(
    "--sun", type=SunPlace(), help="In place of that of the time, such as 135,40."
)
@click.option("--shadows", type=click.IntRange(0), help="Steps towards the sun.")
@click.option("--steps", type=int, help="Through each cloud shell.")
@click.option("--seed", type=int, help="Of clouds and boards.")
@click.option(
    "--flight",
    metavar="FILE.csv",
    help="Columns time (s or UTC), latitude, longitude, height_m: a view that flies.",
)
@click.option(
    "--volume",
    type=int,
    metavar="N",
    help="Write scene_volume.x3d as well, of N x N x N voxels, 8 to 128.",
)
@click.option(
    "--viewer",
    metavar="X3DOM.JS",
    help="x3dom.js of the npm package x3dom, copied beside the page.",
)
def x3d(scene, output, **options) -> None:
    """Write the clouds of a box as X3D, for browsers and globes.

    Clouds come from --weather, --wrf, --retrieval, --particles or --types, or from a
    SCENE, a folder of imagery, with the --parameters of a fit. Writes scene.x3d,
    scene_geo.x3d, scene.glb, viewer.html, textures and manifest.json to DIR.
    """
    from cloudjax_data.whole_files import require_writable
    from cloudjax_scenes.x3d.export import MANIFEST, write_sky
    from cloudjax_scenes.x3d.flight import read_flight
    from cloudjax_scenes.x3d.sky import ExportSettings

    from .progress import tile_progress

    require_writable(output)
    settings = ExportSettings(
        boards=options["boards"],
        pixels=options["pixels"],
        seed=options["seed"] or 0,
        volume=options["volume"],
    )
    flight = None if options["flight"] is None else read_flight(options["flight"])
    times = dict.fromkeys(options.pop("times")) or (None,)
    for time in times:
        sight = _sight(scene, options | {"time": time})
        alone = len(times) == 1
        folder = Path(output) if alone else Path(output) / f"{time:%Y-%m-%dT%H%M}"
        with tile_progress("march") as on_tile:
            made = write_sky(
                folder,
                sight,
                settings,
                flight=flight,
                library=options["viewer"],
                on_tile=on_tile,
            )
        _tell(sight, made, folder / MANIFEST)


def _tell(sight, made, manifest: Path) -> None:
    for note in sight.notes:
        click.echo(f"mind: {note}", err=True)
    seen = made["sectors"]["up"]["mean_opacity"]
    click.echo(
        f"{made['clouds']} clouds on {made['sectors']['up']['boards'][0]} boards; from "
        f"above {seen['boards'][0]:.4f} opaque, the source {seen['source']:.4f}"
    )
    click.echo(f"  {manifest}")


def _sight(scene, options):
    given = [name for name in CLOUD_OPTIONS if options[name]]
    if (scene is not None) + len(given) != 1:
        raise click.UsageError(
            f"clouds come from {EACH_CLOUD_OPTION} or a SCENE: give one"
        )
    if scene is not None:
        refuse(("time", "place", "decision"), options, f"{scene} is a scene")
        return _of_scene(scene, options)
    refuse(_OF_SCENES, options, f"--{given[0]} is no scene")
    for option in COLUMN_OPTIONS:
        if option.name in given:
            return _of_columns(option, options)
    refuse(("place",), options, "the place of an ideal run is for --wrf")
    return _of_weather(options)


def _asked(options, *names):
    return {name: options[name] for name in names if options[name] is not None}


def _of_weather(options):
    from cloudjax_scenes.weather_scene import open_world
    from cloudjax_scenes.x3d.sights import box_about, sight_of_weather

    if options["centre"] is None:
        raise click.UsageError("weather is everywhere: give --centre LAT,LON")
    box = box_about(options["centre"], options["size_km"])
    world = open_world(
        options["weather"],
        options["classes"],
        **_asked(options, "decision", "seed", "steps", "shadows"),
    )
    time = options["time"] or world.series.times[0]
    require_near(time, world)
    return sight_of_weather(world, box, time, options["sun"])


def _of_columns(option: ColumnOption, options):
    from cloudjax_scenes.model_scene import ModelWorld
    from cloudjax_scenes.x3d.sights import box_about, middle_of, sight_of_columns

    columns, time = option.columns(options)
    centre = options["centre"] or middle_of(columns.grid)
    box = box_about(centre, options["size_km"])
    world = ModelWorld(columns, **_asked(options, "steps", "shadows"))
    return sight_of_columns(world, box, time, option.whose, options["sun"])


def _of_scene(scene, options):
    from cloudjax_fit.fit_inputs import read_inputs
    from cloudjax_fit.fitted_image import fitted_scene, fitted_values
    from cloudjax_fit.parameter_file import read_parameters
    from cloudjax_scenes.x3d.sights import box_about, middle_of_image, sight_of_imagery

    file = options["parameters"]
    inputs = read_inputs(
        scene,
        options={name: options[name] for name in ("steps", "seed")},
        classes=options["classes"],
        fitted=None if file is None else read_parameters(file),
        ignore_weather=options["ignore_weather"],
    )
    made_of = inputs.made_of
    centre = options["centre"] or middle_of_image(made_of.imagery)
    box = box_about(centre, options["size_km"])
    values, shadows = fitted_values(inputs), options["shadows"] or 0
    shown = fitted_scene(inputs, values, shadows=shadows)
    return sight_of_imagery(shown, made_of, box, options["sun"])
