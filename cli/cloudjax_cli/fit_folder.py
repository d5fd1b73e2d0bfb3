"""A fit with its progress, its files and its summary. Imports all that it needs."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from cloudjax import CloudClass
from cloudjax_fit.fit_files import REPORT, Images, cloud_fractions, write_fit
from cloudjax_fit.fitting import FitResult, FitSettings, fit
from cloudjax_fit.targets import Target
from cloudjax_scenes.weather_analysis import Analysis

from .progress import fit_progress


NOT_CONVERGED = 1


def fit_and_write(
    target: Target,
    folder: Path,
    settings: FitSettings,
    *,
    overrides: Mapping[str, Mapping[str, Any]] | None = None,
    analysis: Analysis | None = None,
    classes: Mapping[str, CloudClass] | None = None,
    observed: Images | None = None,
) -> int:
    """Fit a target, write the results, and return the exit code."""
    with fit_progress(target.imagery.name, settings.max_steps) as on_step:
        result = fit(
            target,
            settings=settings,
            overrides=overrides,
            analysis=analysis,
            classes=classes,
            on_step=on_step,
        )
    write_fit(result, folder, observed)
    _summarise(result, folder)
    return 0 if result.converged else NOT_CONVERGED


def _summarise(result: FitResult, folder: Path) -> None:
    state = "converged" if result.converged else "NOT converged"
    click.echo(
        f"{result.target.imagery.name}: {state} in {result.seconds['total']:.0f} s"
    )
    if not result.converged:
        click.echo(f"  {result.status}")
    for number, after in result.distances_fit.items():
        before = result.distances_start[number]
        click.echo(
            f"  C{number:02d}  W1 over std {before.w1_over_std:.3f} at the start, "
            f"{after.w1_over_std:.3f} fitted"
        )
    clouds = cloud_fractions(result)
    click.echo(
        f"  cloud fraction {clouds['observed']:.3f} observed, "
        f"{clouds['simulated']:.3f} fitted"
    )
    for warning in result.warnings:
        click.echo(f"  mind: {warning}")
    click.echo(f"  {folder / REPORT}")
