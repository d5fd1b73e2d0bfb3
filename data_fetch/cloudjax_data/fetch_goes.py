"""A time and a sector lead to the ABI files of one scan."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta

from .abi_name import SAME_SCAN
from .buckets import (
    PRODUCTS,
    RADIANCES,
    SECTORS,
    GoesKey,
    Sector,
    goes_bucket,
    goes_folder,
    parse_goes_key,
)
from .errors import DataError
from .fetch_item import AbiItem
from .object_store import Bucket, Link, Listed
from .satellites import in_utc, satellite_at


# The longest repeat of a full disk, in ABI's mode 3: no scan is further away.
WITHIN = timedelta(minutes=15)
# So many scans are told one by one where none has all of the bands.
_SHOWN_SCANS = 4


_File = tuple[GoesKey, Listed]


@dataclass(frozen=True)
class GoesRequest:
    """A `GoesRequest` says which scan is wanted, and which of its files.

    **Fields:**

    - `satellite`: "goes16" to "goes19", or "east" or "west" at that time.
    - `time`: in UTC; the scan that begins nearest to it is taken.
    - `sector`: one of `SECTORS`.
    - `bands`: their numbers; all of one scan.
    - `products`: whether to take the cloud products of the scan too.
    """

    satellite: str
    time: datetime
    sector: str
    bands: tuple[int, ...]
    products: bool = True


@dataclass(frozen=True)
class GoesPlan:
    """A `GoesPlan` names the files of a scan.

    **Fields:** `items`; `start` and `end` of the scan (UTC); `notes`, sentences on
    what could not be had and is not essential.
    """

    items: tuple[AbiItem, ...]
    start: datetime
    end: datetime
    notes: tuple[str, ...] = ()


def plan_goes(request: GoesRequest, link: Link) -> GoesPlan:
    """Find the scan and list its files; nothing is written.

    **Raises:** `DataError` if there is no scan with all of the bands within `WITHIN`
    of the time.
    """
    request = replace(request, time=in_utc(request.time))
    bucket = link.bucket(goes_bucket(satellite_at(request.satellite, request.time)))
    if request.sector not in SECTORS or not request.bands:
        raise DataError(
            f"{request.sector!r} with bands {list(request.bands)} is nothing to fetch: "
            f"use a sector of {', '.join(SECTORS)} and at least one band."
        )
    sector = SECTORS[request.sector]
    scan = _nearest(bucket, request, sector)
    found, notes = list(scan), []
    for product, folders in PRODUCTS.items() if request.products else ():
        file = None
        if sector.folder in folders:
            file = _product(bucket, product, sector, scan[0][0].abi.start)
        if file is None:
            name = product.removeprefix("L2-")
            notes.append(f"{bucket.name} has no {name} of this scan: left out.")
        else:
            found.append(file)
    items = tuple(
        AbiItem(bucket.name, key.key, key.name, listed.size, listed.etag)
        for key, listed in found
    )
    start = min(key.abi.start for key, _ in scan)
    return GoesPlan(items, start, max(key.end for key, _ in scan), tuple(notes))


def _nearest(bucket: Bucket, request: GoesRequest, sector: Sector) -> list[_File]:
    """The files of the scan nearest in time that has all bands."""
    files = [
        file
        for file in _files(bucket, RADIANCES, sector, request.time)
        if file[0].abi.band in request.bands
        and abs(file[0].abi.start - request.time) <= WITHIN
    ]
    scans = [_by_band(scan) for scan in _scans(files)]
    whole = [scan for scan in scans if set(scan) == set(request.bands)]
    if not whole:
        bands = ", ".join(map(str, request.bands))
        raise DataError(
            f"{bucket.origin} has no scan of sector {request.sector} with all of bands "
            f"{bands} within {WITHIN.seconds // 60} minutes of "
            f"{request.time:%Y-%m-%d %H:%M} UTC ({_what_there_is(scans, request)}): "
            "choose another time or other bands; nothing was written."
        )
    nearest = min(whole, key=lambda scan: abs(_start(scan.values()) - request.time))
    return [nearest[band] for band in sorted(nearest)]


def _what_there_is(scans: Sequence[dict[int, _File]], request: GoesRequest) -> str:
    """Which of the nearest scans has which of the bands."""
    if not scans:
        return "nor one of any of them"
    nearest = sorted(scans, key=lambda scan: abs(_start(scan.values()) - request.time))
    shown = sorted(nearest[:_SHOWN_SCANS], key=lambda scan: _start(scan.values()))
    said = [
        f"that of {_start(scan.values()):%H:%M:%S} has only "
        f"{', '.join(map(str, sorted(scan)))}"
        for scan in shown
    ]
    more = len(scans) - len(shown)
    return "; ".join(said) + (f"; and {more} more have not all" if more else "")


def _product(
    bucket: Bucket, product: str, sector: Sector, start: datetime
) -> _File | None:
    """The product of a scan that began at a time, the last one made."""
    same = [
        file
        for file in _files(bucket, product, sector, start, timedelta(0))
        if abs(file[0].abi.start - start) < SAME_SCAN
    ]
    return max(same, key=lambda file: file[0].name, default=None)


def _files(
    bucket: Bucket,
    product: str,
    sector: Sector,
    time: datetime,
    around: timedelta = WITHIN,
) -> Iterator[_File]:
    """What the folders of the hours around a time hold of a product and sector."""
    hours = {time - around, time, time + around}
    for folder in sorted({goes_folder(product, sector, hour) for hour in hours}):
        for listed in bucket.list(folder):
            key = parse_goes_key(listed.key)
            if key is None or not listed.key.startswith(f"{folder}/"):
                continue
            named = f"{key.abi.level}-{key.abi.product}"
            if (named, key.abi.sector) == (product, sector.code):
                yield key, listed


def _scans(files: Sequence[_File]) -> Iterator[list[_File]]:
    """Files that began together, group by group."""
    scan: list[_File] = []
    for file in sorted(files, key=lambda file: file[0].abi.start):
        if scan and file[0].abi.start - scan[0][0].abi.start >= SAME_SCAN:
            yield scan
            scan = []
        scan.append(file)
    if scan:
        yield scan


def _by_band(scan: Iterable[_File]) -> dict[int, _File]:
    # The time of making is last in a name: of two, the reprocessed one stays.
    ordered = sorted(scan, key=lambda file: file[0].name)
    return {file[0].abi.band: file for file in ordered if file[0].abi.band is not None}


def _start(scan: Iterable[_File]) -> datetime:
    return min(key.abi.start for key, _ in scan)
