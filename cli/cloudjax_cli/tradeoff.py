"""`cloudjax tradeoff`."""

import shlex
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


@click.command()
@click.argument("target", metavar="SCENE|SENSOR")
@click.option("-o", "--output", required=True, metavar="DIR", help="For the results.")
@bands_option
@light_option
@click.option("--parameters", metavar="FILE", help="Scene: parameters.toml of a fit.")
@ignore_weather_option
@click.option(
    "--weather", multiple=True, metavar="GRIB", help="Sensor: a global analysis."
)
@click.option(
    "--wrf", multiple=True, metavar="WRFOUT", help="Sensor: a model's own clouds."
)
@click.option("--place", type=Place(), help="Sensor: centre of an ideal WRF run.")
@click.option("--time", type=Time(), help="Sensor: UTC.  [default: of the weather]")
@click.option("--centre", type=Place(), help="Sensor: of a mesoscale sector.")
@click.option(
    "--shadows", type=click.IntRange(0), default=0, help="Steps towards the sun."
)
@click.option(
    "--budget",
    "budget_s",
    type=Duration(),
    default="600s",
    show_default=True,
    help="Time to measure for; the reference and the usual quality are measured "
    "whatever it is.",
)
def tradeoff(target, output, budget_s, shadows, **options) -> None:
    """Measure what accuracy costs, on this machine and for this kind of scene.

    Some of the pixels that `cloudjax render` would make are rendered with more and
    fewer steps, sub-pixel nodes and so on, each timed and compared with a reference.
    Writes tradeoff.json and tradeoff.html to DIR, and keeps the front for
    `cloudjax render --max-error` and `--max-seconds`. Ctrl-C ends it early: what has
    been measured is written.
    """
    from cloudjax_data import DataError
    from cloudjax_data.output_lock import alone
    from cloudjax_data.whole_files import require_writable
    from cloudjax_scenes.trade.sweep import Sweep

    from .subjects import subject_of
    from .trade_files import gathered, write_trade

    folder = Path(output)
    require_writable(folder)
    subject = subject_of(target, shadows=shadows, **options)
    sweep = Sweep.of(subject, budget_s, shadows=shadows)
    with alone(folder, "tradeoff"):
        click.echo(
            f"{subject.name}: {len(subject.rays)} of {subject.outline.pixels} pixels, "
            f"against {sweep.reference.words}"
        )
        front = gathered(subject, sweep)
        if front is None:
            raise DataError(
                f"Nothing of {target} was measured: wait for the reference and one "
                "quality at least."
            )
        command = shlex.join(["cloudjax", "render", target, *_given(options)])
        write_trade(folder, front, command)


def _given(options) -> list[str]:
    """The options that make the same scene, in words of the command line."""
    words = []
    for name, value in options.items():
        flag = f"--{name.replace('_', '-')}"
        if value is True:
            words.append(flag)
        elif name in ("bands", "centre", "place") and value:
            words += [flag, ",".join(map(str, value))]
        elif name in ("weather", "wrf"):
            for file in value:
                words += [flag, file]
        elif name == "time" and value:
            words += [flag, f"{value:%Y-%m-%dT%H:%M}"]
        elif value:
            words += [flag, str(value)]
    return words
