"""`cloudjax report`."""

from pathlib import Path

import click

from .options import BandList, Place, Time, refuse
from .weather_report import PAGE, report_on_weather


_OF_RENDERED_MODELS = ("time", "resolution_km", "place")
_OF_MODELS = (*_OF_RENDERED_MODELS, "allow_mismatch")


@click.command()
@click.argument("a", metavar="A")
@click.argument("b", metavar="[B]", required=False)
@click.option("-o", "--output", required=True, metavar="DIR", help="For the report.")
@click.option(
    "--bands", type=BandList(), help="Bands to compare.  [default: all that both have]"
)
@click.option(
    "--time", type=Time(), help="Model: UTC.  [default: nearest to the imagery's]"
)
@click.option(
    "--resolution-km",
    type=click.FloatRange(0, min_open=True),
    help="Model: pixels to compare in.  [default: those of the coarsest band]",
)
@click.option("--place", type=Place(), help="Model: centre of an ideal WRF run.")
@click.option(
    "--weather",
    metavar="GRIB",
    help="In place of B: the analysis by which A, an image of a sensor, was rendered.",
)
@click.option(
    "--allow-mismatch",
    is_flag=True,
    help="Model, weather: compare although its time or place is not that of the "
    "imagery.",
)
def report(a, b, output, bands, weather, **options) -> None:
    """Compare two sets of radiances, band by band, or an image with its weather.

    A and B are scene folders, ABI files or files that cloudjax wrote; A is taken as the
    observed one. One of them may be a weather model, a wrfout file: it is rendered as
    the other one was seen. With --weather there is no B: the clouds of A, a file of
    cloudjax render SENSOR, are compared with the analysis's. Writes report.html and
    report.json to DIR.
    """
    if weather is not None:
        if b is not None:
            raise click.UsageError("--weather is in place of B: leave one of them out")
        refuse(_OF_RENDERED_MODELS, options, "this is of a model beside imagery")
        report_on_weather(
            a, weather, Path(output), bands, allow_mismatch=options["allow_mismatch"]
        )
        return
    if b is None:
        raise click.UsageError("give B to compare A with, or --weather")
    _compare(a, b, output, bands, options)


def _compare(a, b, output, bands, options) -> None:
    import importlib.metadata

    from cloudjax_data.plain_path import printable
    from cloudjax_data.whole_files import require_writable, staged
    from cloudjax_fit.comparison import compare
    from cloudjax_fit.report import write_comparison

    folder = Path(output)
    require_writable(folder)
    versions = {
        name: importlib.metadata.version(name) for name in ("cloudjax", "numpy")
    }
    first, second, more = _sides(a, b, bands, options)
    names = printable(a), printable(b)
    comparison = compare(first, second, names, versions, **more)
    with staged(folder, last=PAGE) as aside:
        write_comparison(aside / PAGE, comparison)
    for band in comparison.bands:
        d = band.distances
        click.echo(f"  {band.name}  W1 over std {d.w1_over_std:.3f}, KS {d.ks:.3f}")
    if comparison.clouds is not None:
        for line in comparison.clouds.words():
            click.echo(f"  {line}")
    click.echo(f"  {folder / PAGE}")


def _sides(a, b, bands, options):
    """Both radiances, and what else is known of the comparison, by the names of
    `compare`.
    """
    from cloudjax_data import DataError, is_wrf
    from cloudjax_fit.radiance_files import chosen, read_radiances

    models = [is_wrf(path) for path in (a, b)]
    if all(models):
        raise DataError(
            f"{a} and {b} are both of a weather model: render one of them "
            "(cloudjax render SENSOR --wrf) and give the file that is written."
        )
    if not any(models):
        refuse(_OF_MODELS, options, "neither A nor B is a wrfout file")
        return *(chosen(read_radiances(path), bands, path) for path in (a, b)), {}
    model, imagery = (a, b) if models[0] else (b, a)
    beside = _beside(model, imagery, bands, options)
    sides = (beside.image, beside.model)
    told = {"air": beside.air, "facts": beside.facts, "warnings": beside.warnings}
    return *(sides[::-1] if models[0] else sides), told


def _beside(model, imagery, bands, options):
    from cloudjax_data import open_wrf
    from cloudjax_data.plain_path import printable
    from cloudjax_fit.model_as_seen import model_beside
    from cloudjax_fit.model_match import match_model
    from cloudjax_fit.radiance_files import chosen, read_radiances
    from cloudjax_fit.vantage import vantage_of

    from .progress import tile_progress

    radiances = chosen(read_radiances(imagery), bands, imagery)
    vantage = vantage_of(radiances, printable(imagery), options["resolution_km"])
    match = match_model(
        open_wrf(model),
        vantage,
        time=options["time"],
        place=options["place"],
        allow_mismatch=options["allow_mismatch"],
    )
    with tile_progress(Path(model).name) as on_tile:
        beside = model_beside(match, on_tile=on_tile)
    for sentence in beside.warnings:
        click.echo(sentence)
    return beside
