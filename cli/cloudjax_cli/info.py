"""`cloudjax info`."""

import click

from .options import (
    bands_option,
    ignore_weather_option,
    light_option,
    scene_argument,
)


@click.command()
@scene_argument
@bands_option
@ignore_weather_option
@light_option
def info(scene, bands, ignore_weather, light) -> None:
    """Show what a scene holds, and which model parts a run would use."""
    from cloudjax_data import open_folder

    from .folder_facts import folder_rows, run_rows

    folder = open_folder(scene)
    _print(folder_rows(folder))
    click.echo("\nA run would use:")
    _print(run_rows(folder, bands, ignore_weather, light))


def _print(rows) -> None:
    for label, text in rows:
        click.echo(f"{label:<20}{text}")
