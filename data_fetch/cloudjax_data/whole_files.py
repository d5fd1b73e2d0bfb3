"""Files that appear whole: written aside, then moved into place."""

import os
import tempfile
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .errors import DataError
from .plain_path import is_plain, printable


def require_plain(path: str | os.PathLike[str]) -> None:
    """Raise `DataError` for a name of an output that is no text."""
    if not is_plain(path):
        raise DataError(
            f"{printable(path)} has bytes in its name that are no UTF-8, where netCDF "
            "files cannot be written: choose another name for the output."
        )


def require_writable(folder: str | os.PathLike[str]) -> None:
    """Find out before long work, and without a trace, whether a folder can be written.

    **Raises:** `DataError` if it cannot be made or written to, or its name is no text.
    """
    folder = Path(folder)
    require_plain(folder)
    nearest = next(p for p in (folder, *folder.absolute().parents) if p.exists())
    if not nearest.is_dir():
        raise DataError(f"{nearest} is a file: choose a folder for the output.")
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise DataError(
            f"{nearest} is not writable: change its permissions or choose another "
            "folder for the output."
        )


@contextmanager
def whole(
    path: str | os.PathLike[str], aside: str | os.PathLike[str] | None = None
) -> Iterator[Path]:
    """Give a name to write a file under, which then takes that of `path` at once.

    If anything fails it vanishes instead, and an older file stays.

    **Arguments:**

    - `aside`: that name, of the same file system, for writers who take turns. By
        default one of its own, hidden in the folder of `path`, which is made.
    """
    path = Path(path)
    if aside is None:
        path.parent.mkdir(parents=True, exist_ok=True)
        # In the same folder: a rename is atomic only within one file system.
        aside = path.with_name(f".{path.name}.{uuid.uuid4().hex}.tmp")
    aside = Path(aside)
    try:
        yield aside
        os.replace(aside, path)
    finally:
        aside.unlink(missing_ok=True)


def write_text_whole(path: str | os.PathLike[str], text: str) -> None:
    """Write a file of UTF-8 so that no reader, and no crash, ever sees half of it."""
    with whole(path) as aside:
        aside.write_bytes(text.encode())


@contextmanager
def staged(folder: str | os.PathLike[str], last: str = "") -> Iterator[Path]:
    """Give a folder for files that then move into `folder`, or vanish if anything
    fails.

    **Arguments:**

    - `last`: the name of a file whose presence says that the others are whole. The one
        of an earlier run goes first, and the new one comes last.

    **Raises:** `DataError` if the disk does not take them.
    """
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        # In the same folder: a rename is atomic only within one file system.
        with tempfile.TemporaryDirectory(prefix=".writing-", dir=folder) as aside:
            yield Path(aside)
            if last:
                (folder / last).unlink(missing_ok=True)
            files = sorted(Path(aside).iterdir(), key=lambda file: file.name == last)
            for file in files:
                os.replace(file, folder / file.name)
    except OSError as error:
        raise DataError(
            f"{folder} cannot be written ({error.strerror or error}): free some space "
            "or choose another folder for the output."
        ) from error
