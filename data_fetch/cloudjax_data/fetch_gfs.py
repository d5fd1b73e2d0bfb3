"""A time leads to the GFS fields around it, by the byte."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path

from .buckets import CYCLE_HOURS, GFS_BUCKET, GRIDS, gfs_file_name, gfs_key
from .errors import DataError
from .fetch_item import GribItem
from .gfs_index import needed_messages
from .manifest import read_manifest
from .object_store import Bucket, Link
from .satellites import in_utc


# Analyses are six hours apart; forecasts of three hours stand between them.
STEP_HOURS = 3
# The later ones stand in for what is not yet there, or never came.
LEADS_HOURS = (0, 3, 6, 9)
# Those of 0.25 degrees have 32 kB.
_LARGEST_INDEX = 2**20


@dataclass(frozen=True)
class GfsPlan:
    """A `GfsPlan` names the fields around a time.

    **Fields:** `items`; `notes`, sentences on what could not be had.
    """

    items: tuple[GribItem, ...]
    notes: tuple[str, ...] = ()


def plan_gfs(
    time: datetime, grid: str, link: Link, known: Sequence[Path] = ()
) -> GfsPlan:
    """Find the messages of the fields that bracket a time; nothing is written.

    **Arguments:**

    - `time`: in UTC.
    - `grid`: "0p25", "0p50" or "1p00": the step in degrees.
    - `known`: folders whose manifests may already say where the messages are.

    **Raises:** `DataError` if there is nothing on either side of the time.
    """
    if grid not in GRIDS:
        raise DataError(f"{grid!r} is no grid of the GFS: use {', '.join(GRIDS)}.")
    times = bracket(in_utc(time))
    bucket = link.bucket(GFS_BUCKET)
    items, notes = [], []
    for valid in times:
        item = _item(bucket, valid, grid, known)
        if item is None:
            notes.append(
                f"{bucket.name} has no GFS for {valid:%Y-%m-%d %H} UTC: left out."
            )
        else:
            items.append(item)
    if not items:
        raise DataError(
            f"{bucket.origin} has no GFS of grid {grid} around {time:%Y-%m-%d %H:%M} "
            "UTC: choose a time since 2021, or fetch the imagery alone with `fetch "
            "goes`; nothing was written."
        )
    return GfsPlan(tuple(items), tuple(notes))


def bracket(time: datetime) -> tuple[datetime, ...]:
    """Return the multiples of `STEP_HOURS` round a time, or the time if it is one."""
    hour = time.replace(minute=0, second=0, microsecond=0)
    before = hour - timedelta(hours=hour.hour % STEP_HOURS)
    if before == time:
        return (before,)
    return before, before + timedelta(hours=STEP_HOURS)


def _item(
    bucket: Bucket, valid: datetime, grid: str, known: Sequence[Path]
) -> GribItem | None:
    """The fields for a time with the shortest lead that there is."""
    for lead in LEADS_HOURS:
        cycle = valid - timedelta(hours=lead)
        if cycle.hour % CYCLE_HOURS:
            continue
        name = gfs_file_name(cycle, lead, grid)
        for folder in known:
            item = read_manifest(folder).grib_item(name)
            if item is not None and (folder / name).is_file():
                return item
        try:
            return _indexed(bucket, cycle, lead, grid)
        except FileNotFoundError:
            continue
    return None


def _indexed(bucket: Bucket, cycle: datetime, lead: int, grid: str) -> GribItem:
    key = gfs_key(cycle, lead, grid)
    index = bucket.read(f"{key}.idx", _LARGEST_INDEX)
    listed = bucket.head(key)
    try:
        messages = needed_messages(index.decode("ascii"), listed.size, cycle, lead)
    except ValueError as error:
        why = "is not text" if isinstance(error, UnicodeDecodeError) else str(error)
        raise DataError(
            f"{bucket.origin}/{key}.idx {why}: try again later or use another "
            "endpoint; nothing was written."
        ) from error
    name = gfs_file_name(cycle, lead, grid)
    return GribItem(bucket.name, key, name, listed.size, listed.etag, messages)
