"""How far long work has come: a bar on a terminal, plain lines elsewhere."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from datetime import timedelta

import click


# Of the name of a scene and the most steps: what to call with each step and its loss.
FitProgress = Callable[[str, int], AbstractContextManager[Callable[[int, float], None]]]


def no_progress(
    name: str, max_steps: int
) -> AbstractContextManager[Callable[[int, float], None]]:
    """Return what shows nothing, for processes beside the one at the terminal."""
    return nullcontext(lambda step, loss: None)


@contextmanager
def fit_progress(name: str, max_steps: int) -> Iterator[Callable[[int, float], None]]:
    """What to call with the number and the loss of each step of a fit."""
    if sys.stdout.isatty():
        with _bar(name, max_steps) as on_step:
            yield on_step
    else:
        click.echo(f"{name}: preparing and compiling")
        yield lambda step, loss: click.echo(f"{name}: step {step}, loss {loss:.6g}")


@contextmanager
def _bar(name: str, max_steps: int) -> Iterator[Callable[[int, float], None]]:
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn()
    with Progress(*columns, transient=True) as progress:
        task = progress.add_task(f"{name}: preparing and compiling", total=None)

        def on_step(step: int, loss: float) -> None:
            progress.update(
                task,
                total=max_steps,
                completed=step,
                description=f"{name}: step {step} of at most {max_steps}, "
                f"loss {loss:.5g}",
            )

        yield on_step


@contextmanager
def tile_progress(name: str) -> Iterator[Callable[[int, int], None]]:
    """What to call with the numbers of rays done and of all."""
    if sys.stdout.isatty():
        from rich.progress import Progress

        with Progress(transient=True) as progress:
            task = progress.add_task(name, total=None)
            yield lambda done, of: progress.update(task, completed=done, total=of)
    else:
        said = 0

        def on_tile(done: int, of: int) -> None:
            nonlocal said
            if 10 * done // of > said:
                said = 10 * done // of
                click.echo(f"{name}: {10 * said} %")

        yield on_tile


class ScenesLeft:
    """Counts scenes that have ended, and tells how long the others may take."""

    def __init__(self, total: int):
        self._total, self._ended, self._worked, self._failed = total, 0, 0, 0
        self._started = time.monotonic()

    def ended(self, text: str, *, failed: bool = False, kept: bool = False) -> None:
        """Tell of one scene more.

        **Arguments:** `kept`: it took no time, so it says nothing of the others.
        """
        self._ended += 1
        self._failed += failed
        self._worked += not kept
        left = self._total - self._ended
        if not left or not self._worked:
            when = f"{left} left"
        else:
            rate = (time.monotonic() - self._started) / self._worked
            when = f"about {timedelta(seconds=round(left * rate))} left"
        click.echo(
            f"{self._ended} of {self._total} scenes, {self._failed} failed, {when}: "
            f"{text}",
            err=failed,
        )
