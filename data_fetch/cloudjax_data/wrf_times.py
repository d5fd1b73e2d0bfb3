"""WRF files hold several times each, and runs have several files."""

import itertools as it
import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from os import PathLike
from pathlib import Path

import netCDF4
import numpy as np

from .errors import DataError
from .packed import netcdf_file


_SAID = "%Y-%m-%d_%H:%M:%S"
# Of WRF's own files, by which they are known.
_DIMENSIONS = {"south_north", "west_east", "bottom_top"}


@dataclass(frozen=True)
class WrfFrame:
    """A `WrfFrame` is one time of a run.

    **Fields:** `time`: in UTC; `path`, `number`: the file and the place in it.
    """

    time: datetime
    path: Path
    number: int


@dataclass(frozen=True)
class WrfRun:
    """A `WrfRun` holds the times of files of one run, in their order."""

    frames: tuple[WrfFrame, ...]

    @property
    def times(self) -> tuple[datetime, ...]:
        """Give the times, ascending, in UTC."""
        return tuple(frame.time for frame in self.frames)

    def nearest(self, time: datetime) -> WrfFrame:
        """Return the frame whose time is the least from another one."""
        return min(self.frames, key=lambda frame: abs(frame.time - time))

    def at(self, time: datetime | None = None) -> WrfFrame:
        """Return the frame of a time, by default the first.

        **Raises:** `DataError` for a time that no file holds.
        """
        if time is None:
            return self.frames[0]
        for frame in self.frames:
            if abs((frame.time - time).total_seconds()) < 0.5:
                return frame
        first, last = self.frames[0], self.frames[-1]
        more = "" if len(self.frames) == 1 else f" to {last.time.strftime(_SAID)}"
        raise DataError(
            f"{first.path} has no {time.strftime(_SAID)}: its {len(self.frames)} times "
            f"are {first.time.strftime(_SAID)}{more}, choose one of them."
        )


def is_wrf(path: str | PathLike[str]) -> bool:
    """Tell whether a file is of WRF, by what it holds; not if it cannot be read."""
    path = Path(path)
    if not path.is_file():
        return False
    try:
        with netcdf_file(path) as file:
            return file.dimensions.keys() >= _DIMENSIONS
    except DataError:
        return False


def open_wrf(paths: str | PathLike[str] | Sequence[str | PathLike[str]]) -> WrfRun:
    """Find the times that WRF files hold.

    **Arguments:** `paths`: one or several files of one run, in any order.

    **Raises:** `DataError` for a file that is absent or corrupt, has no time, or has a
    time that another one has too.
    """
    several = [paths] if isinstance(paths, str | PathLike) else paths
    frames = [frame for path in several for frame in _frames(Path(path))]
    frames.sort(key=lambda frame: frame.time)
    if not frames:
        raise DataError("A run needs one WRF file at least: add one.")
    for one, other in it.pairwise(frames):
        if one.time == other.time:
            raise DataError(
                f"{one.path} and {other.path} both hold {one.time.strftime(_SAID)}: "
                "keep one of them."
            )
    return WrfRun(tuple(frames))


def _frames(path: Path) -> list[WrfFrame]:
    with netcdf_file(path) as file:
        times = _times(path, file)
    if not times:
        raise DataError(f"{path} holds no time: the run has written nothing yet.")
    return [WrfFrame(time, path, i) for i, time in enumerate(times)]


def _times(path: Path, file: netCDF4.Dataset) -> list[datetime]:
    if "Times" in file.variables:
        stored = np.asarray(file.variables["Times"][:])
        texts = ["".join(row.astype(str)) for row in np.atleast_2d(stored)]
        return [_parsed(path, text) for text in texts if text.strip("\0 ")]
    if "XTIME" not in file.variables:
        raise DataError(
            f"{path} has neither Times nor XTIME: it is no wrfout file, or was "
            "stripped of them; get the file itself."
        )
    minutes = file.variables["XTIME"]
    since = re.search(r"minutes since (\S+[ _]\S+)", str(getattr(minutes, "units", "")))
    start = since[1] if since else str(getattr(file, "SIMULATION_START_DATE", ""))
    begin = _parsed(path, start.replace(" ", "_"))
    counted = np.atleast_1d(np.asarray(minutes[:], float))
    return [begin + timedelta(minutes=float(count)) for count in counted]


def _parsed(path: Path, text: str) -> datetime:
    try:
        return datetime.strptime(text.strip("\0 "), _SAID).replace(tzinfo=UTC)
    except ValueError as error:
        raise DataError(
            f"{path} has the time {text!r}, which is none: write it as "
            "2005-08-28_12:00:00."
        ) from error
