"""Many scenes: each for itself, with progress, and one table in the end."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import click

from cloudjax_data.output_lock import alone
from cloudjax_fit.fit_result import INTERRUPTED, NOT_CONVERGED
from cloudjax_fit.outcome import FAILED, GOOD, NOT_DONE, Outcome
from cloudjax_fit.scene_summary import write_summary

from .progress import ScenesLeft
from .runners import Runner
from .scene_tasks import EXIT_CODES, SceneTask, attempt, failed


def run_scenes(
    tasks: Sequence[SceneTask], runner: Runner, folder: Path, title: str
) -> int:
    """Do what is to be done for each scene, and write the summary to a folder.

    A scene that fails never stops the others. What is found wrong with scenes at once
    is told at once.

    **Returns:** the exit code: the highest of those of the scenes.

    **Raises:** `DataError` if another process writes a summary to the folder, or if no
    worker is to be had.
    """
    with alone(folder, "summary"):
        outcomes: dict[str, Outcome] = {}
        left = ScenesLeft(len(tasks))
        try:
            for outcome in _ended(tasks, runner):
                outcomes[outcome.name] = outcome
                _tell(outcome, left)
                if outcome.state == INTERRUPTED:
                    break
        except KeyboardInterrupt:
            click.echo("Interrupted: --resume does what is missing.", err=True)
        page = write_summary(folder, [_of(task, outcomes) for task in tasks], title)
    click.echo(f"{page}")
    return max(EXIT_CODES[_of(task, outcomes).state] for task in tasks)


def _ended(tasks: Sequence[SceneTask], runner: Runner) -> Iterator[Outcome]:
    """First the scenes that fail at once, then the others as they end."""
    ready = []
    for task in tasks:
        try:
            task.check()
            ready.append(task)
        except Exception as error:
            yield failed(task, error)
    # No cluster is started for nothing.
    for task, result in runner.run(attempt, ready) if ready else ():
        yield failed(task, result) if isinstance(result, Exception) else result


def _of(task: SceneTask, outcomes: dict[str, Outcome]) -> Outcome:
    never = Outcome(task.name, NOT_DONE, "interrupted before its end: --resume does it")
    return outcomes.get(task.name, never)


def _tell(outcome: Outcome, left: ScenesLeft) -> None:
    bad = outcome.state not in (*GOOD, NOT_CONVERGED, INTERRUPTED)
    text = f"{outcome.name} {outcome.state}"
    if outcome.kept:
        text += " (was there)"
    elif bad:
        text += f": {outcome.reason}"
    else:
        text += f" in {outcome.seconds:.0f} s"
    left.ended(text, failed=bad, kept=outcome.kept or outcome.state == FAILED)
