"""A file of a folder belongs to one process at a time, however the others end."""

import contextlib
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path


# Of what is not whole yet: a subfolder, because readers of a folder take its files.
PARTIAL = ".partial"
_LOOK_EVERY_S = 0.05


@contextmanager
def locked(
    folder: Path, name: str, stopped: Callable[[], bool] = lambda: False
) -> Iterator[None]:
    """Keep other processes and threads out of one file of a folder.

    The lock is the kernel's, on an empty file in `PARTIAL`: it ends with its process,
    and what is left of it then keeps nobody out. It is not on the file itself, because
    HDF5 locks what it opens.

    **Arguments:**

    - `stopped`: asked while waiting; `InterruptedError` is raised once it is true.
    """
    path = folder / PARTIAL / f"{name}.lock"
    while True:
        descriptor = _opened(path)
        try:
            _wait(descriptor, stopped)
            # Whoever had it before may have removed it: then it is no lock any more.
            if _names(path, descriptor):
                try:
                    yield
                finally:
                    path.unlink(missing_ok=True)
                return
        finally:
            os.close(descriptor)
            # Others may be at work in it.
            with contextlib.suppress(OSError):
                path.parent.rmdir()


def _opened(path: Path) -> int:
    folder = path.parent
    folder.parent.mkdir(parents=True, exist_ok=True)
    while True:
        # Another process may remove the folder at any time, being done with it.
        try:
            os.mkdir(folder)
        except FileExistsError:
            if folder.is_file():
                raise
        with contextlib.suppress(FileNotFoundError):
            return os.open(path, os.O_RDWR | os.O_CREAT, 0o666)


def _wait(descriptor: int, stopped: Callable[[], bool]) -> None:
    # Not at the top: Windows has no fcntl, and everything else works there.
    import fcntl

    while True:
        if stopped():
            raise InterruptedError
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except BlockingIOError:
            time.sleep(_LOOK_EVERY_S)


def _names(path: Path, descriptor: int) -> bool:
    """Whether the path still leads to the open file."""
    try:
        there, here = os.stat(path), os.fstat(descriptor)
    except FileNotFoundError:
        return False
    return (there.st_dev, there.st_ino) == (here.st_dev, here.st_ino)
