"""`cloudjax render`."""

from pathlib import Path

import click

from .options import bands_option, ignore_weather_option, scene_argument


@click.command()
@scene_argument
@click.option("-o", "--output", required=True, metavar="OUT.nc")
@bands_option
@click.option("--parameters", metavar="FILE", help="The parameters.toml of a fit.")
@click.option("--steps", type=int, help="Through each cloud shell.")
@click.option("--resolution", type=int, help="Voxels per axis.")
@click.option("--seed", type=int, help="Of the clouds.")
@ignore_weather_option
def render(scene, output, bands, parameters, ignore_weather, **options) -> None:
    """Simulate a scene's radiances on its own grid.

    Writes OUT.nc (CF, geostationary) and a picture, OUT.png, beside it. Where clouds
    may stand and what is below them comes from the scene.
    """
    from cloudjax_fit.image_file import write_image_and_picture
    from cloudjax_fit.prepare import prepare
    from cloudjax_fit.rendering import render_run
    from cloudjax_fit.staging import require_writable

    path = Path(output)
    if path.suffix != ".nc":
        raise click.UsageError(f"the output is a netCDF file, and {output} is not *.nc")
    require_writable(path.parent)
    run = prepare(scene, bands=bands, options=options, ignore_weather=ignore_weather)
    image, values = render_run(run, parameters)
    write_image_and_picture(path, image, run.target, values, run.settings.fit.seed)
    click.echo(f"{path} and {path.with_suffix('.png')}")
