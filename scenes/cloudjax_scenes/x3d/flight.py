"""A flight: where a viewer is at which time, from a CSV file, and where it looks."""

import csv
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from jaxtyping import Float

from cloudjax.geometry.geodesy import ecef, geodetic
from cloudjax_data import DataError

from .box import Box


COLUMNS = ("time", "latitude", "longitude", "height_m")
# A straight line between places so far apart is 8 m below the curved one.
_LEG_M = 20e3
# Between two rows; more would not be a way that anybody has flown in one piece.
_LONGEST_LEG_M = 2000e3
# Where in a leg turning to it ends, and turning to the next begins.
_STRAIGHT = (0.25, 0.75)
# Viewers of more sizes of a box away see none of it.
_REACH = 10
_LOWEST_M, _HIGHEST_M = -500.0, 1000e3

PerPoint = Float[np.ndarray, " points"]


@dataclass(frozen=True, eq=False)
class Flight:
    """A `Flight` is a way through the air, straight between its points.

    **Fields:**

    - `name`: of its file.
    - `seconds`: from its start, increasing.
    - `latitude_deg`, `longitude_deg`: of its points; longitudes go on beyond 180.
    - `height_m`: above the ellipsoid.
    """

    name: str
    seconds: PerPoint
    latitude_deg: PerPoint
    longitude_deg: PerPoint
    height_m: PerPoint

    @property
    def position_m(self) -> Float[np.ndarray, "points 3"]:
        """Give where it is, ECEF."""
        return ecef(self.latitude_deg, self.longitude_deg, self.height_m)

    @property
    def share(self) -> PerPoint:
        """Give the times of its points as shares of all of its time."""
        return self.seconds / self.seconds[-1]

    def looks(self) -> tuple[Float[np.ndarray, " looks"], Float[np.ndarray, "looks 3"]]:
        """Return when it looks where: shares of its time, and unit vectors, ECEF.

        It looks along each leg in the middle half of it, and turns between. Where it
        stands still it looks as before.
        """
        way = np.diff(self.position_m, axis=0)
        far = np.linalg.norm(way, axis=-1)
        moving = np.flatnonzero(far > 0)
        # The last leg that moved, for each; the first that does before any has.
        last = np.maximum.accumulate(np.where(far > 0, np.arange(len(far)), -1))
        leg = np.where(last < 0, moving[0], last)
        ahead = (way / np.maximum(far, 1e-9)[:, None])[leg]
        start, took = self.share[:-1, None], np.diff(self.share)[:, None]
        when = (start + took * np.array(_STRAIGHT)).reshape(-1)
        looks = np.repeat(ahead, len(_STRAIGHT), axis=0)
        return np.concatenate([[0.0], when, [1.0]]), looks[[0, *range(len(looks)), -1]]

    def at(self, share: Float[np.ndarray, " times"]) -> Float[np.ndarray, "times 3"]:
        """Return where it is at shares of its time, ECEF."""
        place = self.position_m
        return np.stack([np.interp(share, self.share, x) for x in place.T], axis=-1)

    def require_near(self, box: Box) -> None:
        """Raise `DataError` where it never comes near a box."""
        local = box.local_m(self.position_m)
        nearest = float(np.linalg.norm(local, axis=-1).min())
        if nearest > _REACH * box.size_m:
            raise DataError(
                f"{self.name} stays {nearest / 1e3:.0f} km or more from the middle of "
                "the box, from where no cloud is seen: choose --centre for it."
            )


def read_flight(path: str | os.PathLike[str]) -> Flight:
    """Read a flight from a CSV file with the columns `COLUMNS`.

    Legs follow the Earth: long ones are cut into short ones.

    **Raises:** `DataError` for a file that is absent, lacks a column, or has less than
    two rows, times that do not increase, or places that are none.
    """
    path = Path(path)
    rows = list(_rows(path))
    if len(rows) < 2:
        raise DataError(
            f"{path} has {len(rows)} rows of a flight: it takes two or more."
        )
    times = [row["time"] for row in rows]
    seconds = _seconds(path, times)
    late = np.flatnonzero(np.diff(seconds) <= 0)
    if len(late):
        raise DataError(
            f"{path} goes from {times[late[0]]} to {times[late[0] + 1]}, and times of "
            "a flight have to increase: sort its rows, and leave out what is twice."
        )
    latitude, longitude, height = (
        np.array([_number(path, row, name) for row in rows]) for name in COLUMNS[1:]
    )
    for found, low, high, name in (
        (latitude, -90, 90, "latitude"),
        (longitude, -360, 360, "longitude"),
        (height, _LOWEST_M, _HIGHEST_M, "height_m"),
    ):
        off = found[(found < low) | (found > high)]
        if len(off):
            raise DataError(
                f"{path} has {name} = {off[0]:g}, which no flight has: it is from "
                f"{low:g} to {high:g}."
            )
    return _flown(path, seconds - seconds[0], latitude, longitude, height)


def _flown(path: Path, seconds, latitude, longitude, height) -> Flight:
    """The flight, with points between those that are far from each other."""
    place = ecef(latitude, longitude, height)
    far = np.linalg.norm(np.diff(place, axis=0), axis=-1)
    if far.max() > _LONGEST_LEG_M:
        raise DataError(
            f"{path} leaps by {far.max() / 1e3:.0f} km from one row to the next: give "
            f"rows less than {_LONGEST_LEG_M / 1e3:.0f} km from each other."
        )
    if not far.any():
        raise DataError(f"{path} goes nowhere: give the places of a flight.")
    row = [i + np.arange(n) / n for i, n in enumerate(np.ceil(far / _LEG_M).clip(1))]
    at = np.concatenate([*row, [len(far)]])
    known = np.arange(len(seconds))
    between = np.stack([np.interp(at, known, x) for x in place.T], axis=-1)
    latitude, longitude, _ = geodetic(between)
    # An interpolator must not go around the globe where the count starts anew.
    longitude = np.unwrap(longitude, period=360.0)
    return Flight(
        path.name,
        np.interp(at, known, seconds),
        latitude,
        longitude,
        np.interp(at, known, height),
    )


def _rows(path: Path) -> Iterator[Mapping[str, str]]:
    if not path.is_file():
        raise DataError(f"{path} is not a file: give a CSV file of a flight.")
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file, skipinitialspace=True)
            missing = [c for c in COLUMNS if c not in (reader.fieldnames or ())]
            if missing:
                raise DataError(
                    f"{path} has no column {', '.join(missing)}: its first line has to "
                    f"name {','.join(COLUMNS)}."
                )
            yield from reader
    except (UnicodeDecodeError, csv.Error) as error:
        raise DataError(
            f"{path} is no CSV file in UTF-8 ({error}): save it as one."
        ) from error


def _seconds(path: Path, times: list[str]) -> PerPoint:
    """Seconds, all as numbers or all as times of UTC."""
    try:
        found = np.array([float(time) for time in times])
    except (ValueError, TypeError):
        found = np.array([_utc_s(path, time) for time in times])
    if not np.isfinite(found).all():
        raise DataError(f"{path} has a time that is no number: give it in seconds.")
    return found


def _utc_s(path: Path, text: str | None) -> float:
    try:
        time = datetime.fromisoformat((text or "").strip())
        return time.replace(tzinfo=time.tzinfo or UTC).timestamp()
    except (ValueError, OverflowError) as error:
        raise DataError(
            f"{path} has the time {text!r}: give all in seconds, or all in UTC such as "
            "2026-05-01T18:00:00."
        ) from error


def _number(path: Path, row: Mapping[str, str], name: str) -> float:
    try:
        value = float(row[name])
    except (ValueError, TypeError):
        value = np.nan
    if not np.isfinite(value):
        raise DataError(
            f"{path} has {name} = {row[name]!r} at the time {row['time']}: give a "
            "number."
        )
    return value
