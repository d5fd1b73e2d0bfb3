"""What `cloudjax tradeoff` says and writes. Imports all that it needs."""

import functools as ft
import json
import time
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import click

from cloudjax_data.whole_files import write_text_whole
from cloudjax_scenes.trade.fronts import Front, keep
from cloudjax_scenes.trade.machine import Machine
from cloudjax_scenes.trade.measured import Measured
from cloudjax_scenes.trade.page import trade_page
from cloudjax_scenes.trade.sweep import Sweep
from cloudjax_scenes.trade.trial import Subject, Trial, rendered

from .held_memory import forget_if_much


def gathered(subject: Subject, sweep: Sweep) -> Front | None:
    """Measure until the budget is spent or the user ends it.

    **Returns:** what was measured, None without a reference and a trial.
    """
    end = time.perf_counter() + sweep.budget_s
    trials: list[Trial] = []
    try:
        for trial in sweep.trials(ft.partial(rendered, subject)):
            trials.append(trial)
            forget_if_much()
            left = max(end - time.perf_counter(), 0)
            click.echo(f"{_said(trial)}; {left:.0f} s left")
    except KeyboardInterrupt:
        click.echo(f"Interrupted after {len(trials)} qualities.")
    if len(trials) < 2:
        return None
    scene = Measured(
        name=subject.name,
        outline=subject.outline,
        sample=len(subject.rays),
        reference=trials[0],
        trials=tuple(trials[1:]),
    )
    return Front(subject.outline.kind, Machine.here(), (scene,))


def write_trade(folder: Path, front: Front, command: str) -> None:
    """Write the front as numbers and as a page, keep it, and say where.

    **Arguments:** `command`: that renders the scene, to which a quality's options are
    added.
    """
    write_and_keep(
        folder,
        front.json() | {"command": command},
        trade_page(front, command),
        best=map(_said, front.scenes[0].best),
        keep=lambda: keep(front),
        trials="qualities",
    )


def write_and_keep(
    folder: Path,
    numbers: Mapping[str, Any],
    page: str,
    *,
    best: Iterable[str],
    keep: Callable[[], Path | None],
    trials: str,
) -> None:
    """Write tradeoff.json and tradeoff.html, keep what was measured, and say so.

    **Arguments:** `best`: lines on what nothing beats; `keep`: returns the file, None
    where there is too little to keep; `trials`: what was measured, in the plural.
    """
    write_text_whole(folder / "tradeoff.json", json.dumps(numbers, indent=1) + "\n")
    write_text_whole(folder / "tradeoff.html", page)
    click.echo("Nothing beats:")
    for line in best:
        click.echo(f"  {line}")
    click.echo(f"{folder / 'tradeoff.html'} and tradeoff.json")
    kept = keep()
    click.echo(
        f"Kept as {kept}"
        if kept
        else f"Not kept for --max-error and --max-seconds: too few {trials}, or fewer "
        "than were kept before; allow a greater --budget."
    )


def _said(trial: Trial) -> str:
    errors = ", ".join(
        f"C{number:02d} {error.rmse:.2%}" for number, error in trial.errors.items()
    )
    return f"{trial.quality.words}: {trial.seconds:.3g} s, RMSE/std {errors}"
