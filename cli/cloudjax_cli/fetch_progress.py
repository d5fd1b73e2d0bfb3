"""How far a fetch has come: a bar on a terminal, a line for each file elsewhere."""

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import click

from cloudjax_data import Progress


@contextmanager
def fetch_progress() -> Iterator[Progress]:
    """What `cloudjax_data.fetch` reports to."""
    if not sys.stdout.isatty():
        yield _Lines()
        return
    from rich import progress

    columns = (
        progress.TextColumn("{task.description}"),
        progress.BarColumn(),
        progress.DownloadColumn(),
        progress.TransferSpeedColumn(),
        progress.TimeRemainingColumn(),
    )
    with progress.Progress(*columns, transient=True) as bar:
        yield _Bar(bar)


def megabytes(size: int) -> str:
    """A size in words."""
    return f"{size / 1e6:.1f} MB"


class _Lines(Progress):
    def starts(self, files: int, size: int) -> None:
        click.echo(f"{files} files, {megabytes(size)}")

    def is_whole(self, name: str, size: int, *, fetched: bool) -> None:
        click.echo(f"  {name}  {megabytes(size)}{'' if fetched else ', was there'}")


class _Bar(Progress):
    def __init__(self, bar):
        self._bar, self._task = bar, bar.add_task("")
        self._lock = threading.Lock()
        self._whole = self._files = 0

    def starts(self, files: int, size: int) -> None:
        self._files = files
        self._bar.update(self._task, total=size, description=self._words())

    def advances(self, size: int) -> None:
        self._bar.advance(self._task, size)

    def is_whole(self, name: str, size: int, *, fetched: bool) -> None:
        with self._lock:
            self._whole += 1
            self._bar.update(self._task, description=self._words())

    def _words(self) -> str:
        return f"{self._whole} of {self._files} files"
