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
