"""An output belongs to one process at a time, however the others end."""

import contextlib
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock, Timeout

from .errors import DataError


# For another process to put its last file in place.
_WAIT_S = 1.0


@contextmanager
def alone(folder: str | os.PathLike[str], name: str) -> Iterator[None]:
    """Keep other processes from writing the same output.

    The lock is the system's, on a hidden file that says who has it: it ends with its
    process. Nothing of it stays, the folder neither if nothing was put into it.

    **Arguments:** `name`: what of the folder is written.

    **Raises:** `DataError` if another process writes it.
    """
    folder = Path(folder)
    made = [p for p in (folder, *folder.parents) if not p.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f".{name}.lock"
    lock = FileLock(path)
    try:
        lock.acquire(timeout=_WAIT_S)
    except Timeout:
        raise DataError(
            f"{folder} is being written by {_who(path)}: wait for it to end, or choose "
            "another folder for the output."
        ) from None
    try:
        # Windows lets nobody write to what is locked.
        with contextlib.suppress(OSError):
            path.write_text(f"process {os.getpid()} on {socket.gethostname()}")
        yield
    finally:
        # Before it is released: what is removed later may be another process's.
        with contextlib.suppress(OSError):
            path.unlink()
        lock.release()
        with contextlib.suppress(OSError):
            for one in made:
                one.rmdir()


def _who(path: Path) -> str:
    try:
        return path.read_text() or "another process"
    except OSError:
        return "another process"
