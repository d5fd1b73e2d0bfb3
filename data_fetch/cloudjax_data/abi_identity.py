"""A file of ABI says several times which scan it holds; all of them must agree."""

import re
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

import cftime
import netCDF4
import numpy as np

from .abi_name import SAME_SCAN, AbiName, parse_abi_name
from .errors import DataError
from .packed import attribute, scalar


_SECTORS = {"full": "F", "conus": "C", "pacus": "C", "mesoscale": "M"}
_PLATFORM = re.compile(r"G\d\d")
# A full disk takes 10 to 15 minutes.
_LONGEST_SCAN = timedelta(minutes=30)


@dataclass(frozen=True)
class AbiIdentity:
    """An `AbiIdentity` tells a scan.

    **Fields:** `platform`: "G16" ...; `orbital_slot`; `sector`: "F", "C", "M1" or "M2";
    `start`, `end`: of the scan, in UTC.
    """

    platform: str
    orbital_slot: str
    sector: str
    start: datetime
    end: datetime


def read_identity(file: netCDF4.Dataset, path: Path, number: int) -> AbiIdentity:
    """Read which scan a file holds.

    **Arguments:** `number`: of the band that is read.

    **Raises:** `DataError` if that is missing, or if the header, the variable `t`, the
    name that the header knows and that of the file do not agree.
    """
    platform = str(attribute(file, "platform_ID"))
    if not _PLATFORM.fullmatch(platform):
        raise DataError(
            f"{path} is of a satellite {platform!r}, and ABI flies on G16 to G19: use "
            "files of ABI."
        )
    slot = str(attribute(file, "orbital_slot"))
    if not slot.startswith("GOES"):
        raise DataError(
            f"{path} has an orbital slot {slot!r}, which is none of GOES: download it "
            "again."
        )
    # the header knows its original name; the file may have been renamed
    header = parse_abi_name(str(getattr(file, "dataset_name", "")))
    names = [name for name in (header, parse_abi_name(path.name)) if name is not None]
    identity = AbiIdentity(
        platform,
        slot,
        names[0].sector if names else _sector(file, path),
        _time(file, path, "time_coverage_start"),
        _time(file, path, "time_coverage_end"),
    )
    _check_times(file, path, identity)
    for name in names:
        _check_name(path, name, identity, number)
    return identity


def _sector(file: netCDF4.Dataset, path: Path) -> str:
    scene = str(attribute(file, "scene_id"))
    words = scene.lower().split()
    if not words or words[0] not in _SECTORS:
        raise DataError(
            f"{path} is of a scene {scene!r}, which is no sector of ABI: give the file "
            "the name that NOAA gave it."
        )
    return _SECTORS[words[0]]


def _time(file: netCDF4.Dataset, path: Path, name: str) -> datetime:
    text = str(attribute(file, name))
    try:
        time = datetime.fromisoformat(text)
    except ValueError as error:
        raise DataError(
            f"{path} has {name} {text!r}, which is no time: download it again."
        ) from error
    # All times of NOAA are UTC, whether they say so or not.
    return time.replace(tzinfo=time.tzinfo or UTC).astimezone(UTC)


def _check_times(file: netCDF4.Dataset, path: Path, identity: AbiIdentity) -> None:
    start, end = identity.start, identity.end
    middle = middle_of_scan(file)
    if not timedelta(0) <= end - start <= _LONGEST_SCAN:
        said = f"its scan is from {start:%Y-%m-%d %H:%M:%S} to {end:%Y-%m-%d %H:%M:%S}"
    elif middle is not None and not start - SAME_SCAN <= middle <= end + SAME_SCAN:
        said = (
            f"its scan starts at {start:%Y-%m-%d %H:%M:%S} and its variable 't' says "
            f"{middle:%Y-%m-%d %H:%M:%S}"
        )
    else:
        return
    raise DataError(f"{path} contradicts itself ({said}, UTC): download it again.")


def middle_of_scan(file: netCDF4.Dataset) -> datetime | None:
    """Read the variable `t`; it is None where its units are none of time, too."""
    value = scalar(file, "t")
    if value is None or not np.isfinite(value):
        return None
    units = str(getattr(file.variables["t"], "units", ""))
    calendar = str(getattr(file.variables["t"], "calendar", "standard"))
    try:
        date = cftime.num2date(value, units, calendar, only_use_cftime_datetimes=False)
        return datetime.fromisoformat(date.isoformat()).replace(tzinfo=UTC)
    except (ValueError, OverflowError, AttributeError, TypeError, KeyError):
        return None


def _check_name(path: Path, name: AbiName, identity: AbiIdentity, number: int) -> None:
    apart = abs(name.start - identity.start)
    if name.platform != identity.platform:
        said = f"its name is of {name.platform}, its header of {identity.platform}"
    elif apart >= SAME_SCAN:
        said = (
            f"its name says {name.start:%Y-%m-%d %H:%M:%S}, its header "
            f"{identity.start:%Y-%m-%d %H:%M:%S} UTC"
        )
    elif name.sector != identity.sector:
        said = f"its names are of sectors {identity.sector} and {name.sector}"
    elif name.band not in (None, number):
        said = f"its name is of band {name.band}, its header of band {number}"
    else:
        return
    raise DataError(
        f"{path} contradicts itself ({said}): download it again under its own name."
    )
