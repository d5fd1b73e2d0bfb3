"""A fit with its progress, its files and its summary. Imports all that it needs."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import click

from cloudjax import CloudClass
from cloudjax_data.output_lock import alone
from cloudjax_fit.checkpoint import Checkpoint
from cloudjax_fit.fit_files import REPORT, Images, cloud_fractions, write_fit
from cloudjax_fit.fit_result import FitResult
from cloudjax_fit.fit_settings import FitSettings
from cloudjax_fit.fitting import fit
from cloudjax_fit.targets import Target
from cloudjax_scenes.trade.stopwatch import Stopwatch
from cloudjax_scenes.weather_analysis import Analysis

from .interruption import Interruption
from .progress import FitProgress, fit_progress


# Of the files of a fit.
LOCK = "fit"


def fit_and_write(
    target: Target,
    folder: Path,
    settings: FitSettings,
    *,
    overrides: Mapping[str, Mapping[str, Any]] | None = None,
    analysis: Analysis | None = None,
    classes: Mapping[str, CloudClass] | None = None,
    observed: Images | None = None,
    checkpoint: Checkpoint | None = None,
    progress: FitProgress = fit_progress,
    tell: Callable[[str], None] = click.echo,
    watch: Stopwatch | None = None,
) -> dict[str, Any]:
    """Fit a target, write the results, and return the content of `fit.json`.

    **Arguments:**

    - `checkpoint`: to go on from and to write; it is removed once the fit has ended.
    - `progress`, `tell`: where steps and what came of them are shown.
    - `watch`: to run during the fit, and not while its files are written.

    **Raises:** `KeyboardInterrupt` if Ctrl-C came too early or too late for the solver
    to end with the best so far.
    """
    checkpoint, watch = checkpoint or Checkpoint(), watch or Stopwatch()
    with alone(folder, LOCK), Interruption() as interruption:
        shown = progress(target.imagery.name, settings.max_steps)
        with shown as on_step, watch.running():
            result = fit(
                target,
                settings=settings,
                overrides=overrides,
                analysis=analysis,
                classes=classes,
                on_step=interruption.after(on_step),
                stop=interruption,
                checkpoint=checkpoint,
            )
        numbers = write_fit(result, folder, observed, asked=checkpoint.asked)
        _summarise(result, folder, tell)
        if not result.interrupted:
            checkpoint.remove()
    if interruption.wished and not result.interrupted:
        raise KeyboardInterrupt
    return numbers


def _summarise(result: FitResult, folder: Path, tell: Callable[[str], None]) -> None:
    name = result.target.imagery.name
    state = result.state.replace("not ", "NOT ")
    tell(f"{name}: {state} in {result.seconds['total']:.0f} s")
    if not result.converged:
        tell(f"  {result.status}")
    if result.interrupted:
        tell("  the same command with --resume goes on")
    for number, after in result.distances_fit.items():
        before = result.distances_start[number]
        tell(
            f"  C{number:02d}  W1 over std {before.w1_over_std:.3f} at the start, "
            f"{after.w1_over_std:.3f} fitted"
        )
    clouds = cloud_fractions(result)
    tell(
        f"  cloud fraction {clouds['observed']:.3f} observed, "
        f"{clouds['simulated']:.3f} fitted"
    )
    for warning in result.warnings:
        tell(f"  mind: {warning}")
    tell(f"  {folder / REPORT}")
