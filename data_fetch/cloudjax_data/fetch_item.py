"""Each file to be fetched has an origin, a name, and a way to tell that it is whole."""

import hashlib
import re
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import netCDF4

from .abi_name import parse_abi_name
from .errors import DataError
from .gfs_index import Message, joined_ranges
from .grib import grib_contents
from .packed import attribute, netcdf_file


# Rows read at a time: whole chunks of ABI files, which have 226 or 250 rows.
_ROWS = 1000
_MD5 = re.compile(r'"?(?P<md5>[0-9a-f]{32})"?')
# GRIB2, section 0: "GRIB", reserved, discipline, edition, length of the message.
_SECTION_0 = 16


@dataclass(frozen=True)
class FetchItem(ABC):
    """A `FetchItem` is a file to be fetched.

    **Fields:**

    - `bucket`, `key`: the object.
    - `name`: of the file; a plain name, made here and not by the server.
    - `object_size`: in bytes, as the store says.
    - `etag`: the store's tag of the object, with its quotes; None without one.
    """

    bucket: str
    key: str
    name: str
    object_size: int
    etag: str | None

    def __post_init__(self):
        if Path(self.name).name != self.name or self.name[:1] in ("", "."):
            raise DataError(
                f"{self.name!r} is not a plain file name: use another endpoint; "
                "nothing was written."
            )

    @property
    @abstractmethod
    def ranges(self) -> tuple[tuple[int, int], ...]:
        """Give the bytes to fetch, each range from its first to before its last."""

    @property
    def size(self) -> int:
        """Count the bytes to fetch, and so those of the file."""
        return sum(end - start for start, end in self.ranges)

    @property
    def identity(self) -> str:
        """Give a text that differs where a part of one file must not be continued as
        another.
        """
        parts = repr((self.bucket, self.key, self.etag, self.ranges))
        return hashlib.sha256(parts.encode()).hexdigest()[:12]

    @property
    def md5(self) -> str | None:
        """Give the checksum of the file where the tag is one; tags of multipart uploads
        are not.
        """
        match = _MD5.fullmatch(self.etag or "")
        return match["md5"] if match else None

    @abstractmethod
    def check(self, path: Path) -> None:
        """Open the file, and raise `DataError` or `ValueError` if it is not what it
        should be.
        """


@dataclass(frozen=True)
class AbiItem(FetchItem):
    """An `AbiItem` is a whole ABI file."""

    @property
    def ranges(self) -> tuple[tuple[int, int], ...]:
        return ((0, self.object_size),)

    def check(self, path: Path) -> None:
        with netcdf_file(path) as file:
            inside = parse_abi_name(str(attribute(file, "dataset_name")))
            if inside != parse_abi_name(self.name):
                raise ValueError("it says of itself to be another file")
            if self.md5 is None:
                _read_through(file)


@dataclass(frozen=True)
class GribItem(FetchItem):
    """A `GribItem` joins messages of a GRIB file."""

    messages: tuple[Message, ...]

    @property
    def md5(self) -> str | None:
        return None

    @property
    def ranges(self) -> tuple[tuple[int, int], ...]:
        return joined_ranges(self.messages)

    def check(self, path: Path) -> None:
        spans = sorted({(m.start, m.end) for m in self.messages})
        _check_frames(path, [end - start for start, end in spans])
        wanted = {(m.level_type, m.name, m.level) for m in self.messages}
        missing = wanted - grib_contents(path)
        if missing:
            raise ValueError(f"it lacks {len(missing)} of {len(wanted)} fields")


def _read_through(file: netCDF4.Dataset) -> None:
    """Read every variable, so that whatever cannot be unpacked shows itself."""
    for variable in file.variables.values():
        if not variable.shape:
            variable[...]
        for row in range(0, variable.shape[0] if variable.shape else 0, _ROWS):
            variable[row : row + _ROWS]


def _check_frames(path: Path, lengths: Sequence[int]) -> None:
    """Both ends of each message, which decoders skip without a word if broken."""
    with path.open("rb") as stream:
        position = 0
        for length in lengths:
            stream.seek(position)
            head = stream.read(_SECTION_0)
            stream.seek(position + length - 4)
            whole = (
                head[:4] == b"GRIB"
                and head[7:8] == b"\x02"
                and int.from_bytes(head[8:]) == length
                and stream.read(4) == b"7777"
            )
            if not whole:
                raise ValueError(f"its message at byte {position} is broken")
            position += length
