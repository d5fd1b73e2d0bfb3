"""`cloudjax fetch`."""

import functools as ft
from pathlib import Path

import click

from .errors import INTERRUPTED
from .options import BandList, Time


_TIME = click.option("--time", required=True, type=Time(), help="UTC, ISO 8601.")

_GOES = (
    click.option(
        "--satellite",
        required=True,
        metavar="NAME",
        help="goes16, goes17, goes18, goes19, or east or west at that time.",
    ),
    _TIME,
    click.option(
        "--sector",
        required=True,
        type=click.Choice(["full", "conus", "meso1", "meso2"]),
    ),
    click.option(
        "--bands",
        type=BandList(),
        default="1,3,13,15",
        help="The default is what fits use by day and night.",
    ),
    click.option(
        "--products/--no-products",
        default=True,
        help="Cloud-top height, clear-sky mask and optical depth of the scan.",
    ),
)
_GRID = click.option(
    "--grid",
    type=click.Choice(["1p00", "0p50", "0p25"]),
    default="1p00",
    help="Step of the GFS in degrees: about 10, 35 or 120 MB for each analysis.",
)
_COMMON = (
    click.option("-o", "--output", required=True, metavar="DIR", type=Path),
    click.option("--dry-run", is_flag=True, help="List names and sizes only."),
    click.option(
        "--cache",
        envvar="CLOUDJAX_CACHE",
        show_envvar=True,
        metavar="DIR",
        type=Path,
        help="Shared by several fetches; DIR then holds links.",
    ),
    click.option(
        "--endpoint",
        envvar="CLOUDJAX_ENDPOINT",
        show_envvar=True,
        metavar="URL",
        help="An S3-compatible mirror, or a folder with a subfolder for each bucket.  "
        "[default: NOAA's buckets]",
    ),
    click.option(
        "--timeout",
        type=click.FloatRange(min=0, min_open=True),
        default=30.0,
        help="Seconds of silence after which a connection is taken up anew.",
    ),
    click.option("--retries", type=click.IntRange(min=0), default=5),
)


def _options(*options):
    """Several options at once, shown in their order."""
    return lambda command: ft.reduce(lambda c, o: o(c), reversed(options), command)


@click.group()
def fetch() -> None:
    """Bring NOAA's open data into a folder, without credentials.

    What is there already is not transferred again, and what was begun goes on where it
    stopped.
    """


@fetch.command()
@_options(*_GOES, _GRID, *_COMMON)
def scene(satellite, time, sector, bands, products, grid, output, **common) -> int:
    """A scene folder: the scan nearest to a time and the GFS around it."""
    from cloudjax_data import GoesRequest, plan_scene

    request = GoesRequest(satellite, time, sector, bands, products)
    return _bring(
        lambda link, known: plan_scene(request, grid, link, known), output, **common
    )


@fetch.command()
@_options(*_GOES, *_COMMON)
def goes(satellite, time, sector, bands, products, output, **common) -> int:
    """The ABI files of the scan nearest to a time."""
    from cloudjax_data import GoesRequest, plan_goes

    request = GoesRequest(satellite, time, sector, bands, products)
    return _bring(lambda link, known: plan_goes(request, link), output, **common)


@fetch.command()
@_options(_TIME, _GRID, *_COMMON)
def gfs(time, grid, output, **common) -> int:
    """The GFS fields that bracket a time: only the messages that are needed."""
    from cloudjax_data import plan_gfs

    return _bring(
        lambda link, known: plan_gfs(time, grid, link, known), output, **common
    )


def _bring(plan, output, *, dry_run, cache, endpoint, timeout, retries) -> int:
    """List what a plan finds, and fetch it unless it is a dry run."""
    from cloudjax_data import Link
    from cloudjax_data import fetch as fetch_items

    from .fetch_progress import fetch_progress, megabytes

    link = Link(endpoint=endpoint, timeout_s=timeout, retries=retries)
    found = plan(link, tuple(folder for folder in (output, cache) if folder))
    for note in found.notes:
        click.echo(f"mind: {note}")
    if dry_run:
        for item in found.items:
            click.echo(f"  {item.name}  {megabytes(item.size)}")
        total = sum(item.size for item in found.items)
        click.echo(f"{len(found.items)} files, {megabytes(total)}: nothing fetched")
        return 0
    try:
        with fetch_progress() as progress:
            done = fetch_items(
                found.items, output, link, cache=cache, progress=progress
            )
    except KeyboardInterrupt:
        click.echo(
            f"Interrupted: what is in {output} is whole, and the same command goes on "
            "from the begun parts.",
            err=True,
        )
        return INTERRUPTED
    click.echo(f"{output}: {megabytes(done.transferred)} transferred")
    return 0
