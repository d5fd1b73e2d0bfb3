"""What `cloudjax tradeoff --fit` measures, says and writes. Imports all it needs."""

import time
from pathlib import Path

import click

from cloudjax_data import DataError
from cloudjax_data.output_lock import alone
from cloudjax_fit.fit_inputs import read_inputs
from cloudjax_fit.trade.fronts import FitFront, keep
from cloudjax_fit.trade.measured import MeasuredFits
from cloudjax_fit.trade.page import fit_trade_page
from cloudjax_fit.trade.quality import FitQuality
from cloudjax_fit.trade.sweep import FitSweep
from cloudjax_fit.trade.trial import FitSubject, Fitted, FitTrial, fitted
from cloudjax_scenes.trade.machine import Machine

from .held_memory import forget_if_much
from .progress import fit_progress
from .trade_files import write_and_keep


def measure_fits(target: str, folder: Path, budget_s: float, command: str, **given):
    """Fit the scene of a folder again and again, and write and keep the front.

    **Arguments:** `command`: that fits the scene, to which rays and steps are added;
    `given`: `bands`, `light`, `statistics` and `ignore_weather`.

    **Raises:** `click.UsageError` where the target is no folder; `DataError` where
    nothing was measured.
    """
    if not Path(target).is_dir():
        raise click.UsageError(f"{target} is no folder of a scene, which --fit needs")
    subject, sweep = _subject(target, **given), FitSweep(budget_s)
    with alone(folder, "tradeoff"):
        click.echo(f"{target}: {subject.outline.kind}, against {sweep.reference.words}")
        front = gathered(subject, sweep)
        if front is None:
            raise DataError(
                f"No fits of {target} were measured: wait for the reference and one "
                "more at least."
            )
        write_fit_trade(folder, front, command)


def _subject(target: str, *, bands, light, statistics, ignore_weather) -> FitSubject:
    inputs = read_inputs(
        target,
        bands=bands,
        options={"light": light, "statistics": statistics},
        ignore_weather=ignore_weather,
    )
    return FitSubject(
        target,
        inputs.target,
        inputs.settings.fit,
        inputs.analysis,
        inputs.overrides,
        inputs.made_of.known,
    )


def gathered(subject: FitSubject, sweep: FitSweep) -> FitFront | None:
    """Fit until the budget is spent or the user ends it.

    **Returns:** what was measured, None without a reference and a trial.
    """
    end = time.perf_counter() + sweep.budget_s
    trials: list[FitTrial] = []

    def shown(quality: FitQuality) -> Fitted:
        name = f"{subject.name}, {quality.words}"
        with fit_progress(name, subject.settings.max_steps) as on_step:
            return fitted(subject, quality, on_step)

    try:
        for trial in sweep.trials(shown):
            forget_if_much()
            if not trial.sound:
                click.echo(f"{trial.quality.words}: found no numbers, and is left out")
                continue
            trials.append(trial)
            left = max(end - time.perf_counter(), 0)
            click.echo(f"{_said(trial)}; {left:.0f} s left")
    except KeyboardInterrupt:
        click.echo(f"Interrupted after {len(trials)} fits.")
    if len(trials) < 2:
        return None
    scene = MeasuredFits(
        name=subject.name,
        outline=subject.outline,
        reference=trials[0].fitted,
        trials=tuple(trials[1:]),
    )
    return FitFront(subject.outline.kind, Machine.here(), scene)


def write_fit_trade(folder: Path, front: FitFront, command: str) -> None:
    """Write the front as numbers and as a page, keep it, and say where.

    **Arguments:** `command`: that fits the scene, to which rays and steps are added.
    """
    write_and_keep(
        folder,
        front.json() | {"command": command},
        fit_trade_page(front, command),
        best=map(_said, front.scene.best),
        keep=lambda: keep(front),
        trials="fits",
    )


def _said(trial: FitTrial) -> str:
    off = f"parameters off by {trial.error:.0%} of a standard deviation"
    return (
        f"{trial.quality.words}: {trial.fitted.state}, {trial.seconds:.3g} s and "
        f"{trial.fitted.compiled_s:.0f} s to compile, "
        f"{off if trial.error else 'the reference'}"
    )
