"""NOAA's public buckets have names and a layout (docs/guides/fetch.md has the sources).

What a server lists is parsed here, whole, before any of it is used: the patterns admit
nothing that could lead out of a folder.
"""

import re
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from .abi_name import AbiName, parse_abi_name


GFS_BUCKET = "noaa-gfs-bdp-pds"
GRIDS = ("0p25", "0p50", "1p00")
CYCLE_HOURS = 6

RADIANCES = "L1b-Rad"
# Cloud-top height, clear-sky mask, optical depth: by the sectors that have them.
PRODUCTS = {"L2-ACHA": "FCM", "L2-ACM": "FCM", "L2-COD": "FC"}

# GFS version 16, whose files moved into a folder of the component.
_ATMOS_SINCE = datetime(2021, 3, 22, 12, tzinfo=UTC)

_GOES_KEY = re.compile(
    r"ABI-[A-Za-z0-9]+-[A-Za-z0-9]+/[0-9]{4}/[0-9]{3}/[0-9]{2}/"
    r"(?P<name>OR_ABI-(?:L1b|L2)-[A-Za-z0-9]+-M[0-9](?:C[0-9]{2})?_G[0-9]{2}"
    r"_s[0-9]{14}_e(?P<end>[0-9]{13})(?P<tenths>[0-9])_c[0-9]{14}\.nc)"
)


@dataclass(frozen=True)
class Sector:
    """A `Sector` is a part of the Earth that ABI scans.

    **Fields:** `folder`: the letter that ends the names of products; both mesoscale
    sectors share one. `code`: what `AbiName.sector` says.
    """

    folder: str
    code: str


SECTORS = {
    "full": Sector("F", "F"),
    "conus": Sector("C", "C"),
    "meso1": Sector("M", "M1"),
    "meso2": Sector("M", "M2"),
}


@dataclass(frozen=True)
class GoesKey:
    """A `GoesKey` is the key of an ABI file, taken apart.

    **Fields:** `key`; `name` of the file; `abi`, what the name says; `end` of the scan.
    """

    key: str
    name: str
    abi: AbiName
    end: datetime


def goes_bucket(satellite: str) -> str:
    """Return the bucket of "goes16" ..."""
    return f"noaa-{satellite}"


def goes_folder(product: str, sector: Sector, hour: datetime) -> str:
    """Return the folder of the scans of a product that began in an hour (UTC)."""
    return f"ABI-{product}{sector.folder}/{hour:%Y/%j/%H}"


def parse_goes_key(key: str) -> GoesKey | None:
    """Return the parts of a key, or None unless all of it is as NOAA writes them."""
    match = _GOES_KEY.fullmatch(key)
    abi = parse_abi_name(match["name"]) if match else None
    if match is None or abi is None:
        return None
    try:
        end = datetime.strptime(match["end"], "%Y%j%H%M%S").replace(tzinfo=UTC)
    except ValueError:
        return None
    end += timedelta(milliseconds=100 * int(match["tenths"]))
    return GoesKey(key, match["name"], abi, end)


def gfs_key(cycle: datetime, lead_hours: int, grid: str) -> str:
    """Return the key of the fields of one cycle (UTC) and lead time; the index adds
    `.idx`.
    """
    folder = f"gfs.{cycle:%Y%m%d/%H}"
    if cycle >= _ATMOS_SINCE:
        folder += "/atmos"
    return f"{folder}/gfs.t{cycle:%H}z.pgrb2.{grid}.f{lead_hours:03d}"


def gfs_file_name(cycle: datetime, lead_hours: int, grid: str) -> str:
    """Return the name under which the messages of one file are kept; NOAA's lacks the
    date.
    """
    return f"gfs.{cycle:%Y%m%d}.t{cycle:%H}z.pgrb2.{grid}.f{lead_hours:03d}.grib2"
