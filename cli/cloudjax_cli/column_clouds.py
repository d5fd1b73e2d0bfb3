"""Options of clouds that stand in columns: measured, computed or made up."""

import functools as ft
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING, Any

import click

from .options import Place, refuse


if TYPE_CHECKING:
    from cloudjax_scenes.model_columns import CloudColumns


Options = Mapping[str, Any]


@dataclass(frozen=True)
class ColumnOption:
    """An option that says where clouds come from, and how they are read.

    **Fields:**

    - `name`: of the option.
    - `whose`: the clouds are.
    - `read`: columns, and the time of the sun.
    """

    name: str
    whose: str
    read: Callable[[Any, Options], "tuple[CloudColumns, datetime]"]

    def columns(self, options: Options) -> "tuple[CloudColumns, datetime]":
        """Read the columns, once options that do not apply are refused."""
        own = f"clouds of --{self.name} are {self.whose}"
        refuse(("classes", "decision"), options, own)
        if self.name != "wrf":
            refuse(("place",), options, "the place of an ideal run is for --wrf")
        return self.read(options[self.name], options)


def _of_a_model(wrf, options: Options):
    from cloudjax_data import open_wrf, read_wrf

    columns = read_wrf(open_wrf(wrf).at(options["time"]), options["place"])
    return columns, columns.time


def _retrieved(folder: str, options: Options):
    from cloudjax_data import read_retrieval
    from cloudjax_scenes.retrieved_columns import RetrievedColumns

    columns = RetrievedColumns.of(read_retrieval(folder))
    return columns, options["time"] or columns.time


def _of_particles(file: str, options: Options):
    from cloudjax_scenes.particle_columns import ParticleColumns

    columns = ParticleColumns.read(file, options["time"])
    return columns, columns.time


def _by_type(file: str, options: Options):
    from cloudjax_data import DataError
    from cloudjax_scenes.by_type.placing import particles_of
    from cloudjax_scenes.by_type.sky_file import read_sky
    from cloudjax_scenes.particle_columns import ParticleColumns

    sky = read_sky(file)
    origin = sky.origin_deg or options["centre"]
    if origin is None:
        raise DataError(
            f"{file} has no origin: add [origin] with latitude_deg and longitude_deg, "
            "or give --centre."
        )
    particles = particles_of(sky, origin)
    columns = ParticleColumns.of(particles, sky.path, options["time"] or sky.time)
    return columns, columns.time


def column_options(command):
    """Options of which one says where clouds come from."""
    every = (
        click.option(
            "--wrf",
            multiple=True,
            metavar="WRFOUT",
            help="A weather model's own clouds; again for more files of the run.",
        ),
        click.option(
            "--retrieval",
            metavar="FOLDER",
            help="Clouds of a GOES scan, from its COD and ACHA files.",
        ),
        click.option(
            "--particles", metavar="FILE.nc", help="Clouds of cloudjax particles."
        ),
        click.option(
            "--types", metavar="TOML", help="Clouds by type, where the file puts them."
        ),
        click.option("--place", type=Place(), help="WRF: centre of an ideal run."),
    )
    return ft.reduce(lambda c, option: option(c), reversed(every), command)


COLUMN_OPTIONS = (
    ColumnOption("wrf", "a weather model's own", _of_a_model),
    ColumnOption("retrieval", "what the satellite has seen", _retrieved),
    ColumnOption("particles", "those of the file", _of_particles),
    ColumnOption("types", "those of the file", _by_type),
)
