"""Paths whose bytes are no text, which the netCDF library cannot be told."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


def is_plain(path: str | os.PathLike[str]) -> bool:
    """Tell whether a path is text: names made elsewhere may be in another encoding."""
    try:
        os.fspath(path).encode("utf-8")
    except UnicodeEncodeError:
        return False
    return True


@contextmanager
def plain_path(path: Path) -> Iterator[Path]:
    """Give a path that is text: the same one, or that of a link to the file."""
    if is_plain(path):
        yield path
        return
    with tempfile.TemporaryDirectory(prefix="cloudjax-") as folder:
        link = Path(folder, f"link{path.suffix}" if is_plain(path.suffix) else "link")
        link.symlink_to(path.absolute())
        yield link


def printable(text: str | os.PathLike[str]) -> str:
    """Return a path as text: bytes that are none are spelt as `\\xff`."""
    return os.fsencode(os.fspath(text)).decode("utf-8", "backslashreplace")
