"""`manifest.json` says where the files of a folder came from."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from .fetch_item import FetchItem, GribItem
from .file_lock import PARTIAL, locked
from .gfs_index import SELECTION, Message
from .whole_files import whole


MANIFEST = "manifest.json"
_VERSION = 1
_BLOCK = 2**20


@dataclass(frozen=True)
class Checksums:
    """`Checksums` are the size of a file in bytes, its MD5 for the tags of S3, and its
    SHA-256 for the record.
    """

    size: int
    md5: str
    sha256: str


@dataclass(frozen=True)
class Manifest:
    """A `Manifest` holds the records of a folder, by the names of its files.

    **Fields:** `files`: by name `origin` (URL), `bucket`, `key`, `object_size`, `etag`,
    `fetched` (UTC), `size`, `sha256`, and of a GFS file `selection` and `messages`
    (type of level, name, level, first byte, byte after the last).
    """

    files: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    def holds(self, folder: Path, item: FetchItem) -> bool:
        """Tell whether the folder has the file, byte for byte as it was fetched."""
        record, path = self.files.get(item.name), folder / item.name
        return (
            record is not None
            and (record.get("etag"), record.get("size")) == (item.etag, item.size)
            and path.is_file()
            and path.stat().st_size == item.size
            and record.get("sha256") == checksums(path).sha256
        )

    def grib_item(self, name: str) -> GribItem | None:
        """Return a GFS file as it was fetched, or None if what is needed of it has
        changed.
        """
        record = self.files.get(name, {})
        if record.get("selection") != SELECTION:
            return None
        try:
            messages = tuple(Message(*fields) for fields in record["messages"])
            return GribItem(
                record["bucket"],
                record["key"],
                name,
                record["object_size"],
                record["etag"],
                messages,
            )
        except (KeyError, TypeError):
            return None


def read_manifest(folder: Path) -> Manifest:
    """Read the records of a folder; there are none if none can be read."""
    try:
        return _parsed((folder / MANIFEST).read_bytes())
    except OSError:
        return Manifest()


def record(folder: Path, item: FetchItem, origin: str, sums: Checksums) -> None:
    """Add one file to the manifest of a folder; several processes may do so at once."""
    entry: dict[str, Any] = {
        "origin": f"{origin}/{item.key}",
        "bucket": item.bucket,
        "key": item.key,
        "object_size": item.object_size,
        "etag": item.etag,
        "fetched": f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}",
        "size": sums.size,
        "sha256": sums.sha256,
    }
    if isinstance(item, GribItem):
        entry["selection"] = SELECTION
        entry["messages"] = [
            [m.level_type, m.name, m.level, m.start, m.end] for m in item.messages
        ]
    with locked(folder, MANIFEST):
        files = {**read_manifest(folder).files, item.name: entry}
        content = {"version": _VERSION, "files": dict(sorted(files.items()))}
        with whole(folder / MANIFEST, folder / PARTIAL / MANIFEST) as aside:
            aside.write_text(json.dumps(content, indent=1), encoding="utf-8")


def checksums(path: Path) -> Checksums:
    """Read a file once, whatever its size."""
    size, md5, sha256 = 0, hashlib.md5(usedforsecurity=False), hashlib.sha256()
    with path.open("rb") as stream:
        while block := stream.read(_BLOCK):
            size += len(block)
            md5.update(block)
            sha256.update(block)
    return Checksums(size, md5.hexdigest(), sha256.hexdigest())


def _parsed(content: bytes) -> Manifest:
    # Unreadable records cost another look at the files, and no more.
    try:
        files = json.loads(content or b"{}").get("files", {})
        return Manifest({name: dict(entry) for name, entry in files.items()})
    except (ValueError, AttributeError, TypeError):
        return Manifest()
