"""`cloudjax info`."""

from pathlib import Path

import click

from .options import (
    bands_option,
    ignore_weather_option,
    light_option,
)


@click.command()
@click.argument("scene", metavar="SCENE|GRIB", type=click.Path(path_type=str))
@bands_option
@ignore_weather_option
@light_option
def info(scene, bands, ignore_weather, light) -> None:
    """Show what a scene holds, and which model parts a run would use.

    Of a weather file, what `render SENSOR --weather` takes from it.
    """
    from cloudjax_data import open_folder
    from cloudjax_data.grib_messages import is_grib

    if Path(scene).is_file() and is_grib(Path(scene)):
        from .weather_facts import weather_rows

        _print(weather_rows(Path(scene)))
        return
    from .folder_facts import folder_rows, run_rows

    folder = open_folder(scene)
    _print(folder_rows(folder))
    click.echo("\nA run would use:")
    _print(run_rows(folder, bands, ignore_weather, light))


def _print(rows) -> None:
    for label, text in rows:
        click.echo(f"{label:<{max(20, len(label) + 2)}}{text}")
