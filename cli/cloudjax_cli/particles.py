"""`cloudjax particles`."""

from pathlib import Path

import click

from .options import Place, Time, frame_file, refuse


class Viewer(click.ParamType):
    """Latitude, longitude and height in km, such as 25,-90,400."""

    name = "lat,lon,km"

    def convert(self, value, param, ctx):
        try:
            latitude, longitude, km = map(float, value.split(","))
        except ValueError:
            self.fail(f"{value!r} is no place and height such as 25,-90,400")
        return latitude, longitude, km


@click.command()
@click.argument("sources", nargs=-1, required=True, metavar="WRFOUT...|FOLDER")
@click.option("-o", "--output", required=True, metavar="OUT.nc|OUT.ply")
@click.option("-n", "--count", type=int, default=100_000, help="Of particles.")
@click.option(
    "--sampler",
    type=click.Choice(["systematic", "rejection"]),
    default="systematic",
    help="Equal strides through the optical depth, or draws that are kept by it.",
)
@click.option("--k", type=float, help="Of rejection: the constant K.  [default: 1]")
@click.option("--time", type=Time(), help="UTC.  [default: the first of the files]")
@click.option("--place", type=Place(), help="Centre of an ideal run.")
@click.option("--frames", type=click.IntRange(1), default=1, help="Moments.")
@click.option(
    "--minutes",
    type=click.FloatRange(0, min_open=True),
    default=10.0,
    help="Between frames.",
)
@click.option(
    "--viewer", type=Viewer(), help="From whom far particles are fewer and larger."
)
@click.option("--near-km", type=float, help="Distance up to which all are kept.")
@click.option(
    "--power",
    type=float,
    help="Of the distance, by which they get fewer.  [default: 3]",
)
@click.option("--seed", type=int, default=0)
def particles(sources, output, **options) -> None:
    """Turn clouds of a weather model, or of a GOES scan, into particles.

    Several wrfout files are those of one run. Frames between its times drift with its
    winds. A FOLDER has the COD and ACHA files of one scan. Writes OUT.nc (CF) or
    OUT.ply; of several frames OUT-000.nc and so on.
    """
    from cloudjax_data.whole_files import require_plain, require_writable
    from cloudjax_scenes.particle_files import require_particle_file, write_particles

    require_plain(output)
    path = require_particle_file(output)
    require_writable(path.parent)
    thinned = _detail(options)
    named = ", ".join(Path(source).name for source in sources)
    for i, (time, found) in enumerate(_frames(sources, options)):
        kept = thinned(found)
        file = frame_file(path, i, options["frames"])
        write_particles(file, kept, time, {"source_files": named})
        area = kept.extinction_area_m2.sum() / 1e6
        click.echo(f"{file}  {len(kept)} particles, {area:.4g} km2 of optical depth")


def _frames(sources, options):
    """Moments, and the particles that live then."""
    from cloudjax_data import open_wrf
    from cloudjax_scenes.particle_series import ParticleSeries

    sampler, count, seed = _sampler(options), options["count"], options["seed"]
    if any(Path(source).is_dir() for source in sources):
        return _of_a_scan(sources, sampler, options)
    run = open_wrf(sources)
    series = ParticleSeries(run, count, sampler, seed, options["place"])
    start = options["time"] or run.times[0]
    return series.frames(start, options["frames"], options["minutes"])


def _of_a_scan(folders, sampler, options):
    from cloudjax.particles.placement import place
    from cloudjax_data import DataError, read_retrieval
    from cloudjax_scenes.model_columns import depth_columns
    from cloudjax_scenes.retrieved_columns import RetrievedColumns

    refuse(("time", "place"), options, f"{folders[0]} is a scan of one time and place")
    if len(folders) > 1 or options["frames"] > 1:
        raise click.UsageError(
            "a scan has one moment: give one folder, and leave out --frames"
        )
    columns = RetrievedColumns.of(read_retrieval(folders[0]))
    try:
        found = place(
            depth_columns(columns),
            options["count"],
            sampler=sampler,
            seed=options["seed"],
        )
    except ValueError as error:
        raise DataError(str(error)) from error
    for caution in columns.cautions():
        click.echo(caution)
    return [(columns.time, found)]


def _sampler(options):
    from cloudjax.particles.placement import Acceptance, Systematic
    from cloudjax_data import DataError

    if options["sampler"] == "systematic":
        refuse(("k",), options, "K is of --sampler rejection")
        return Systematic()
    try:
        return Acceptance(1.0 if options["k"] is None else options["k"])
    except ValueError as error:
        raise DataError(str(error)) from error


def _detail(options):
    """What thins particles by their distance from the viewer, where there is one."""
    import numpy as np

    from cloudjax.geometry.geodesy import ecef
    from cloudjax.particles.detail import LevelOfDetail
    from cloudjax_data import DataError

    if options["viewer"] is None:
        refuse(("near_km", "power"), options, "nobody looks: give --viewer, or")
        return lambda found: found
    if options["near_km"] is None:
        raise click.UsageError("particles get fewer from where: give --near-km")
    power = 3.0 if options["power"] is None else options["power"]
    try:
        detail = LevelOfDetail(1e3 * options["near_km"], power)
    except ValueError as error:
        raise DataError(str(error)) from error
    latitude, longitude, km = (np.array(part) for part in options["viewer"])
    eye = ecef(latitude, longitude, np.array(1e3 * km))

    def thinned(found):
        away = np.linalg.norm(found.position_m() - eye, axis=-1)
        return detail.thinned(found, away, options["seed"])

    return thinned
