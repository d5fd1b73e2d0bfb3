"""`cloudjax tradeoff`."""

import shlex
from pathlib import Path
from typing import Any

import click

from .options import (
    Duration,
    Place,
    Time,
    bands_option,
    ignore_weather_option,
    light_option,
)


# To measure for where nobody says: a render takes seconds, and a fit minutes.
_RENDERS_S, _FITS_S = 600.0, 1800.0


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
    "--fit",
    "of_fits",
    is_flag=True,
    help="Scene: measure fits of it instead, with more and fewer rays and steps.",
)
@click.option(
    "--statistics", help="With --fit: texture, or values alone.  [default: texture]"
)
@click.option(
    "--budget",
    "budget_s",
    type=Duration(),
    help="Time to measure for; the reference and the usual quality are measured "
    "whatever it is.  [default: 600s, and 30min with --fit]",
)
def tradeoff(target, output, budget_s, shadows, of_fits, statistics, **options) -> None:
    """Measure what accuracy costs, on this machine and for this kind of scene.

    Some of the pixels that `cloudjax render` would make are rendered with more and
    fewer steps, sub-pixel nodes and so on, each timed and compared with a reference.
    Writes tradeoff.json and tradeoff.html to DIR, and keeps the front for
    `cloudjax render --max-error` and `--max-seconds`. With --fit whole fits are made
    and compared, for the same options of `cloudjax fit`. Ctrl-C ends it early: what has
    been measured is written.
    """
    from cloudjax_data.whole_files import require_writable

    if of_fits:
        given = _of_fits(shadows=shadows, **options) | {"statistics": statistics}
        require_writable(output)

        from .fit_tradeoff import measure_fits

        command = shlex.join(["cloudjax", "fit", target, *_given(given)])
        measure_fits(target, Path(output), budget_s or _FITS_S, command, **given)
        return
    if statistics is not None:
        raise click.UsageError("--statistics is of fits: add --fit")
    require_writable(output)
    _of_renders(target, Path(output), budget_s or _RENDERS_S, shadows, options)


def _of_fits(*, bands, light, ignore_weather, **others) -> dict[str, Any]:
    """The options that fits have, once all others are found to be absent."""
    for name, value in others.items():
        if value:
            raise click.UsageError(f"--{name} is of renders: leave it or --fit out")
    return {"bands": bands, "light": light, "ignore_weather": ignore_weather}


def _of_renders(target, folder: Path, budget_s: float, shadows, options) -> None:
    from cloudjax_data import DataError
    from cloudjax_data.output_lock import alone
    from cloudjax_scenes.trade.sweep import Sweep

    from .subjects import subject_of
    from .trade_files import gathered, write_trade

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
