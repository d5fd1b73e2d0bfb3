"""Options that several commands share."""

import functools as ft
from datetime import UTC, datetime
from pathlib import Path

import click

from .runners import Cluster


class BandList(click.ParamType):
    """Band numbers separated by commas, such as 1,3,13."""

    name = "n,n,..."

    def convert(self, value, param, ctx):
        if isinstance(value, tuple):
            return value
        try:
            numbers = sorted({int(part) for part in value.split(",")})
        except ValueError:
            self.fail(f"{value!r} is not a list of band numbers such as 1,3,13")
        if not all(1 <= number <= 16 for number in numbers):
            self.fail(f"{value!r} names a band that ABI lacks: it has 1 to 16")
        return tuple(numbers)


class Time(click.ParamType):
    """A time in ISO 8601, of UTC unless it says otherwise."""

    name = "time"

    def convert(self, value, param, ctx):
        if isinstance(value, datetime):
            return value
        try:
            time = datetime.fromisoformat(value)
            return time.replace(tzinfo=time.tzinfo or UTC).astimezone(UTC)
        except (ValueError, OverflowError):
            self.fail(f"{value!r} is not a time such as 2023-04-26T17:00")


class Duration(click.ParamType):
    """A time to wait for, in seconds: 120, 120s or 2min."""

    name = "seconds"
    _units = (("min", 60.0), ("s", 1.0), ("", 1.0))

    def convert(self, value, param, ctx):
        if isinstance(value, float):
            return value
        unit, in_s = next(both for both in self._units if value.endswith(both[0]))
        try:
            seconds = float(value.removesuffix(unit)) * in_s
        except ValueError:
            self.fail(f"{value!r} is not a time such as 120s or 2min")
        if not 0 < seconds < float("inf"):
            self.fail(f"{value!r} is no time to work in: give more than 0 s")
        return seconds


class Place(click.ParamType):
    """Latitude and longitude in degrees, such as 25,-80."""

    name = "lat,lon"

    def convert(self, value, param, ctx):
        try:
            latitude, longitude = map(float, value.split(","))
        except ValueError:
            self.fail(f"{value!r} is not a latitude and a longitude such as 25,-80")
        return latitude, longitude


bands_option = click.option(
    "--bands",
    type=BandList(),
    help="Bands to use.  [default: those of scene.toml, else 1,3,13 by day and 13,15 "
    "by night, as far as the scene has them]",
)

ignore_weather_option = click.option(
    "--ignore-weather",
    is_flag=True,
    help="Go on without the weather files of the scene, however far from its time.",
)

weather_mask_option = click.option(
    "--weather-mask",
    is_flag=True,
    help="Take where clouds are from the weather file, not from the imagery.",
)

classes_option = click.option(
    "--classes", metavar="TOML", help="Classes of cloud, in place of the built-in ones."
)

decision_option = click.option(
    "--decision",
    metavar="NAME",
    help="Where clouds are in the weather: evidence, all that the analysis tells, or "
    "table1, the paper's.  [default: evidence]",
)

light_option = click.option("--light", help="physical or paper.  [default: physical]")

dask_option = click.option(
    "--dask",
    "runner",
    type=Cluster(),
    help="Scenes at once, on workers of this machine or of a cluster.  [default: one "
    "after the other]",
)

resume_option = click.option(
    "--resume",
    is_flag=True,
    help="Keep what an earlier run has done with the same settings and inputs, and do "
    "the rest.",
)

# Of earlier releases, whose textures had voxels to choose. It still does no harm.
resolution_option = click.option(
    "--resolution", type=int, hidden=True, deprecated=True, expose_value=False
)

# Checked with those of scene.toml, by the same rules.
_FIT_OPTIONS = (
    click.option("--rays", type=int, help="Pixels simulated at each step."),
    click.option("--steps", type=int, help="Steps through each cloud shell."),
    resolution_option,
    click.option("--starts", type=int, help="Starts; the best fit is kept."),
    click.option("--max-steps", type=int, help="Steps of the solver at most."),
    click.option("--seed", type=int, help="Of clouds, rays and starts."),
    click.option("--statistics", help="texture, or values alone.  [default: texture]"),
    light_option,
)


def fit_options(command):
    """All that `cloudjax_fit.FitSettings` holds, by the same names."""
    return ft.reduce(lambda c, option: option(c), reversed(_FIT_OPTIONS), command)


def frame_file(path: Path, i: int, frames: int) -> Path:
    """Name the file of one of so many frames: OUT-003.nc, or OUT.nc if it is alone."""
    return path if frames == 1 else path.with_stem(f"{path.stem}-{i:03d}")


def refuse(names, options, because: str) -> None:
    """End with a sentence if one of these options has been given."""
    for name in names:
        # Not "if options[name]": a longitude may be 0.
        if options[name] is not None and options[name] is not False:
            option = name.replace("_", "-")
            raise click.UsageError(f"{because}: leave out --{option}")
