"""Files come from a bucket into a folder, whole or not at all.

Each grows in the subfolder `.partial` under a lock, goes on from where an earlier run
or a broken connection left it, is checked, and then takes its name in the folder.
"""

import contextlib
import errno
import os
import shutil
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path

from obstore.exceptions import BaseError, PreconditionError

from .errors import DataError
from .fetch_item import FetchItem
from .file_lock import PARTIAL, locked
from .manifest import Checksums, checksums, read_manifest, record
from .object_store import Bucket, Link, Retry, is_final, reason
from .whole_files import whole


_FULL = {errno.ENOSPC, errno.EDQUOT}
# Ranges of one file at once.
_AHEAD = 8
# HDF5 crashes when two threads are in it.
_OPENING = threading.Lock()


class Progress:
    """A `Progress` is told, from several threads, how files come in; this one does
    nothing.
    """

    def starts(self, files: int, size: int) -> None:
        """Hear that so many files of so many bytes together are to come."""

    def advances(self, size: int) -> None:
        """Hear of so many bytes more; fewer, below 0, when a file starts over."""

    def is_whole(self, name: str, size: int, *, fetched: bool) -> None:
        """Hear that a file is in its place, fetched now or before."""


@dataclass(frozen=True)
class Fetched:
    """A `Fetched` says what a fetch did.

    **Fields:** `paths`, of all files; `transferred`, bytes that came over the link.
    """

    paths: tuple[Path, ...]
    transferred: int


def fetch(
    items: Sequence[FetchItem],
    folder: Path,
    link: Link,
    *,
    cache: Path | None = None,
    progress: Progress | None = None,
) -> Fetched:
    """Bring files into a folder, several at once; those that are there stay.

    **Arguments:**

    - `cache`: a folder that several fetches share, at the same time if need be: files
        come to lie there and are linked into `folder`, or copied to another disk.

    **Raises:** `DataError` in one sentence that says what happened and what is left.
    """
    transfers = _Transfers(items, folder, cache or folder, link, progress or Progress())
    try:
        transfers.folder.mkdir(parents=True, exist_ok=True)
        return transfers.run()
    except (OSError, _Broken) as error:
        raise DataError(f"{_what(error, folder)}; {transfers.left()}.") from error


class _Broken(Exception):
    """A file that cannot be had; the message says which and why."""


class _Transfers:
    """The transfers of one fetch and what they share."""

    def __init__(
        self,
        items: Sequence[FetchItem],
        folder: Path,
        cache: Path,
        link: Link,
        progress: Progress,
    ):
        self.items, self.folder, self.cache = items, folder, cache
        self.link, self.progress = link, progress
        self.stop = threading.Event()
        self.buckets = {name: link.bucket(name) for name in {i.bucket for i in items}}

    def run(self) -> Fetched:
        self.progress.starts(len(self.items), sum(item.size for item in self.items))
        with ThreadPoolExecutor(self.link.connections) as pool:
            futures = [pool.submit(self.bring, item) for item in self.items]
            try:
                wait(futures, return_when=FIRST_EXCEPTION)
            finally:
                self.stop.set()
                for future in futures:
                    future.cancel()
        for future in futures:
            error = None if future.cancelled() else future.exception()
            if error is not None and not isinstance(error, InterruptedError):
                raise error
        paths = tuple(self.folder / item.name for item in self.items)
        return Fetched(paths, sum(future.result() for future in futures))

    def bring(self, item: FetchItem) -> int:
        """Have one file in the folder; returns the bytes that were transferred."""
        if read_manifest(self.folder).holds(self.folder, item):
            self.progress.advances(item.size)
            self.progress.is_whole(item.name, item.size, fetched=False)
            return 0
        transferred = self._into_cache(item)
        if self.cache != self.folder:
            _place(self.cache / item.name, self.folder / item.name)
            sums = checksums(self.folder / item.name)
            record(self.folder, item, self.buckets[item.bucket].origin, sums)
        self.progress.is_whole(item.name, item.size, fetched=transferred > 0)
        return transferred

    def _into_cache(self, item: FetchItem) -> int:
        final = self.cache / item.name
        partial = self.cache / PARTIAL / f"{item.name}.{item.identity}"
        with locked(self.cache, item.name, self.stop.is_set):
            # Perhaps another process brought it while this one waited.
            if read_manifest(self.cache).holds(self.cache, item):
                self.progress.advances(item.size)
                return 0
            transferred, sums = 0, _sums_if_whole(final, item)
            if sums is None:
                transferred, sums = self._transfer(item, partial)
                os.replace(partial, final)
            else:
                self.progress.advances(item.size)
            record(self.cache, item, self.buckets[item.bucket].origin, sums)
            _remove_parts(partial.parent, item.name)
        return transferred

    def _transfer(self, item: FetchItem, partial: Path) -> tuple[int, Checksums]:
        """Fill a partial file; a second time if it turns out to be spoilt."""
        bucket = self.buckets[item.bucket]
        transferred, wrong = 0, None
        for _ in range(2):
            with _appended(partial, item.size) as descriptor:
                transferred += self._fill(bucket, item, descriptor)
                os.fsync(descriptor)
            sums = checksums(partial)
            wrong = _wrong(item, partial, sums)
            if wrong is None:
                return transferred, sums
            partial.unlink()
            self.progress.advances(-item.size)
        raise _Broken(f"{bucket.origin}/{item.key} came spoilt twice ({wrong})")

    def _fill(self, bucket: Bucket, item: FetchItem, descriptor: int) -> int:
        """Append what a partial file lacks; returns how much that was."""
        begun = os.lseek(descriptor, 0, os.SEEK_END)
        self.progress.advances(begun)
        done, retry = begun, Retry(self.link, self.stop)
        while done < item.size:
            before = done
            try:
                for block in _missing(bucket, item, done):
                    if self.stop.is_set():
                        raise InterruptedError
                    if done + len(block) > item.size:
                        raise _Broken(
                            f"{bucket.origin}/{item.key} is longer than listed"
                        )
                    _write(descriptor, block)
                    done += len(block)
                    self.progress.advances(len(block))
                if done == before:
                    raise ConnectionError("the connection ended too early")
            except (BaseError, FileNotFoundError, ConnectionError) as error:
                if done > before:
                    retry.progressed()
                if is_final(error) or not retry.wait():
                    raise _unobtainable(bucket, item, error) from error
        return done - begun

    def left(self) -> str:
        """What of the files is on disk, in words."""
        whole = sum((self.folder / item.name).is_file() for item in self.items)
        begun = self.cache / PARTIAL
        parts = sum(bool(_parts(begun, item.name)) for item in self.items)
        there = f"{self.folder} holds {whole} of {len(self.items)} files, whole"
        if not parts:
            return f"{there}, and nothing else is left"
        return (
            f"{there}, and {begun} the begun parts of {parts}, from which the same "
            "command goes on"
        )


def _missing(bucket: Bucket, item: FetchItem, done: int) -> Iterator[bytes]:
    """The bytes of a file after the first `done`, in their order."""
    ranges = list(_after(item.ranges, done))
    if len(ranges) == 1:
        yield from bucket.stream(item.key, *ranges[0], item.etag)
        return

    def part(span: tuple[int, int]) -> bytes:
        content = b"".join(bucket.stream(item.key, *span, item.etag))
        if len(content) != span[1] - span[0]:
            # What follows would end up in the wrong place.
            raise ConnectionError("a part came short")
        return content

    # Many small ranges: asked for one after the other they would wait for the network
    # more than they use it.
    with ThreadPoolExecutor(_AHEAD) as pool:
        for batch in range(0, len(ranges), _AHEAD):
            yield from pool.map(part, ranges[batch : batch + _AHEAD])


def _after(ranges: Sequence[tuple[int, int]], done: int) -> Iterator[tuple[int, int]]:
    """What is left of ranges after their first `done` bytes."""
    for start, end in ranges:
        skipped = min(done, end - start)
        done -= skipped
        if skipped < end - start:
            yield start + skipped, end


@contextlib.contextmanager
def _appended(path: Path, size: int) -> Iterator[int]:
    """A file to be made or continued up to a size, unless it is longer already."""
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT, 0o666)
    try:
        if os.fstat(descriptor).st_size > size:
            os.ftruncate(descriptor, 0)
        yield descriptor
    finally:
        os.close(descriptor)


def _write(descriptor: int, block: bytes) -> None:
    view = memoryview(block)
    while view:
        view = view[os.write(descriptor, view) :]


def _sums_if_whole(path: Path, item: FetchItem) -> Checksums | None:
    """The checksums of a file that is there without a record, and right."""
    if not path.is_file() or path.stat().st_size != item.size:
        return None
    sums = checksums(path)
    return sums if _wrong(item, path, sums) is None else None


def _wrong(item: FetchItem, path: Path, sums: Checksums) -> str | None:
    """Why a file is not what it should be, None if it is."""
    if sums.size != item.size:
        return f"{sums.size} bytes instead of {item.size}"
    if item.md5 not in (None, sums.md5):
        return "its checksum is not that of the store"
    try:
        with _OPENING:
            item.check(path)
    except (DataError, ValueError) as error:
        return reason(error)
    return None


def _place(source: Path, target: Path) -> None:
    """The same file in another folder: linked, or else copied."""
    aside = target.with_name(PARTIAL) / f"{target.name}.copy"
    with locked(target.parent, target.name), whole(target, aside):
        aside.unlink(missing_ok=True)
        try:
            os.link(source, aside)
        except OSError:
            shutil.copyfile(source, aside)


def _remove_parts(folder: Path, name: str) -> None:
    """Remove what was begun of a file that is whole, of other versions of it too."""
    for left in _parts(folder, name):
        (folder / left).unlink(missing_ok=True)


def _parts(folder: Path, name: str) -> list[str]:
    there = os.listdir(folder) if folder.is_dir() else []
    return [p for p in there if p.startswith(f"{name}.") and p != f"{name}.lock"]


def _unobtainable(bucket: Bucket, item: FetchItem, error: Exception) -> _Broken:
    changed = isinstance(error, PreconditionError)
    why = "it is another one than was listed" if changed else reason(error)
    return _Broken(f"{bucket.origin}/{item.key} could not be had ({why})")


def _what(error: Exception, folder: Path) -> str:
    """What happened, in words that begin a sentence."""
    if isinstance(error, OSError) and error.errno in _FULL:
        return f"The disk of {folder} is full: free some space and run it again"
    if isinstance(error, OSError):
        where = error.filename or folder
        return f"{where} cannot be written ({error.strerror or error})"
    return f"{error}: try again, or another endpoint"
