"""What is to be done for one scene, as plain values that another process can take."""

import os
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol, runtime_checkable

import click

from cloudjax_fit.fit_result import CONVERGED, INTERRUPTED, NOT_CONVERGED
from cloudjax_fit.outcome import FAILED, FAULT, NOT_DONE, RENDERED, TESTED, Outcome

from . import errors


EXIT_CODES = {
    CONVERGED: 0,
    RENDERED: 0,
    TESTED: 0,
    NOT_CONVERGED: 1,
    FAILED: errors.BAD_INPUT,
    FAULT: errors.FAULT,
    INTERRUPTED: errors.INTERRUPTED,
    NOT_DONE: errors.INTERRUPTED,
}


@runtime_checkable
class SceneTask(Protocol):
    """A task of one scene, which needs no other scene and can be pickled."""

    @property
    def name(self) -> str:
        """Return what the scene is called in progress and summary."""
        ...

    def check(self) -> None:
        """Find what is found at once, and forget what is not to be gone on from.

        **Raises:** `DataError` for what stands in the way of the run.
        """
        ...

    def __call__(self) -> Outcome:
        """Do it all, and say what came of it.

        **Raises:** `DataError` for what stands in the way of the run.
        """
        ...


def attempt(task: SceneTask) -> Outcome:
    """Do a task; what it raises becomes the outcome of its scene."""
    started = time.perf_counter()
    try:
        return task()
    except Exception as error:
        outcome = failed(task, error)
        return replace(outcome, seconds=time.perf_counter() - started)


def failed(task: SceneTask, error: Exception) -> Outcome:
    """Return the outcome of a task that has raised an exception."""
    sentence, code = errors.told(error)
    return Outcome(task.name, FAULT if code == errors.FAULT else FAILED, sentence)


def scene_name(scene: str) -> str:
    """Return what the folder of a scene is called."""
    return os.path.basename(os.path.abspath(scene))


def distinct_names(scenes: Sequence[str]) -> list[str]:
    """Return the names of scenes.

    **Raises:** `click.UsageError` if two are the same.
    """
    names = [scene_name(scene) for scene in scenes]
    if len(set(names)) < len(names):
        raise click.UsageError("two of the scenes have the same name: give them apart")
    return names
