"""Files that appear whole: written aside, then moved into place."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from cloudjax_data import DataError


def require_writable(folder: str | os.PathLike[str]) -> None:
    """Find out before long work, and without a trace, whether a folder can be written.

    **Raises:** `DataError` if it cannot be made or written to.
    """
    folder = Path(folder)
    nearest = next(p for p in (folder, *folder.absolute().parents) if p.exists())
    if not nearest.is_dir():
        raise DataError(f"{nearest} is a file: choose a folder for the output.")
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise DataError(
            f"{nearest} is not writable: change its permissions or choose another "
            "folder for the output."
        )


@contextmanager
def staged(folder: str | os.PathLike[str], last: str = "") -> Iterator[Path]:
    """A folder for files that then move into `folder`, or vanish if anything fails.

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
