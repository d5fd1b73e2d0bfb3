"""How far long work has come: a bar on a terminal, plain lines elsewhere."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import click


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
