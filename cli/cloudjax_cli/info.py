"""`cloudjax info`."""

from pathlib import Path

import click

from .options import (
    Duration,
    Place,
    Time,
    bands_option,
    ignore_weather_option,
    light_option,
)


_OF_COSTS = ("weather", "time", "centre", "shadows", "budget")


@click.command()
@click.argument("target", metavar="SCENE|SENSOR|GRIB")
@bands_option
@ignore_weather_option
@light_option
@click.option(
    "--cost",
    is_flag=True,
    help="List the parts of the model, which are used, and what each costs here.",
)
@click.option(
    "--weather", multiple=True, metavar="GRIB", help="With --cost: for a sensor."
)
@click.option("--time", type=Time(), help="With --cost: UTC, for a sensor.")
@click.option("--centre", type=Place(), help="With --cost: of a mesoscale sector.")
@click.option(
    "--shadows", type=click.IntRange(0), help="With --cost: steps towards the sun."
)
@click.option(
    "--budget",
    type=Duration(),
    help="With --cost: time to measure for.  [default: 60s]",
)
def info(target, bands, ignore_weather, light, cost, **options) -> None:
    """Show what a scene holds, and which model parts a run would use.

    Of a weather file, what `render SENSOR --weather` takes from it. With --cost also
    what each part costs on this machine, timed with and without it on some of the
    pixels; a SENSOR, as for `cloudjax render`, has costs alone.
    """
    if not cost:
        given = [name for name in _OF_COSTS if options[name]]
        if given:
            raise click.UsageError(f"--{given[0]} is for --cost: give that too")
        _print_folder(target, bands, ignore_weather, light)
        return
    from .cost_lines import cost_lines
    from .subjects import subject_of

    if Path(target).is_dir():
        _print_folder(target, bands, ignore_weather, light)
        click.echo("")
    click.echo("What the whole image costs, once compiled, and each part of it:")
    shadows = options["shadows"] or 0
    subject = subject_of(
        target,
        bands=bands,
        light=light,
        ignore_weather=ignore_weather,
        weather=options["weather"],
        time=options["time"],
        centre=options["centre"],
        shadows=shadows,
    )
    budget_s = options["budget"] or 60.0
    for line in cost_lines(subject, shadows=shadows, budget_s=budget_s):
        click.echo(line)


def _print_folder(scene, bands, ignore_weather, light) -> None:
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
