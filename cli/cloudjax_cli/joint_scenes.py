"""Several scenes fitted together, and others seen with what they have in common."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from cloudjax_data.output_lock import alone
from cloudjax_fit.checkpoint import Checkpoint, checkpoint_in
from cloudjax_fit.fit_files import FILES, IMAGE, parameter_row, write_fit
from cloudjax_fit.fit_inputs import FitInputs
from cloudjax_fit.fittable_scene import FittableScene
from cloudjax_fit.joint_files import (
    whole_joint,
    write_joint_fit,
    write_test,
)
from cloudjax_fit.joint_fitting import JointFit, TestedScene, joint_fit
from cloudjax_fit.outcome import TESTED, Outcome, outcome_of_fit, outcome_of_test
from cloudjax_fit.scene_summary import write_summary
from cloudjax_fit.sharing import Sharing

from .fit_folder import LOCK
from .interruption import Interruption
from .progress import fit_progress
from .scene_fit import SceneFit
from .scene_tasks import EXIT_CODES


TITLE = "Scenes fitted together"


@dataclass(frozen=True)
class JointScenes:
    """Scenes to fit together.

    **Fields:**

    - `fits`: of the scenes, each with the folder of its own results.
    - `tests`: scenes that are not fitted, but seen with the shared parameters.
    - `folder`: of the summary and of what is shared.
    - `resume`: an earlier run that has ended stays, and one that has not goes on.
    """

    fits: Sequence[SceneFit]
    tests: Sequence[SceneFit]
    folder: Path
    sharing: Sharing
    resume: bool = False

    def __call__(self) -> int:
        """Fit the scenes, write all files, and return the exit code.

        **Raises:** `DataError` for whatever stands in the way of any scene.
        """
        for task in (*self.fits, *self.tests):
            task.check()
        asked = self._asked()
        with ExitStack() as locks:
            for folder in (self.folder, *(Path(task.folder) for task in self.fits)):
                locks.enter_context(alone(folder, LOCK))
            checkpoint = checkpoint_in(self.folder, asked)
            done = self._done(asked) if self.resume else None
            if done is not None:
                checkpoint.remove()
                click.echo(f"{done['status']} in an earlier run: {self.folder}")
                return EXIT_CODES[done["status"]]
            if not self.resume:
                checkpoint.remove()
            return self._fit(checkpoint)

    def _done(self, asked: str) -> Mapping[str, Any] | None:
        """What an earlier run has found, if all its files are there."""
        files = [Path(task.folder) / name for task in self.fits for name in FILES]
        files += [Path(task.folder) / IMAGE for task in self.tests]
        whole = all(file.is_file() for file in files)
        return whole_joint(self.folder, asked) if whole else None

    def _asked(self) -> str:
        """A digest of what is to be done."""
        asked = {
            "fits": [task.asked() for task in self.fits],
            "tests": [task.asked() for task in self.tests],
            "shared": list(self.sharing.rules.items()),
        }
        return hashlib.sha256(json.dumps(asked).encode()).hexdigest()

    def _fit(self, checkpoint: Checkpoint) -> int:
        inputs = [task.inputs() for task in self.fits]
        # What is wrong with them is told before the fit.
        others = [_fittable(task.inputs()) for task in self.tests]
        with Interruption() as interruption:
            scenes = [_fittable(one) for one in inputs]
            joint = _solved(scenes, self.sharing, interruption, checkpoint)
            outcomes = []
            for task, one, result in zip(
                self.fits, inputs, joint.results(), strict=True
            ):
                asked = f"together with others: {checkpoint.asked}"
                numbers = write_fit(result, task.folder, one.observed, asked=asked)
                outcomes.append(outcome_of_fit(task.name, numbers, page=task.page))
                _tell(outcomes[-1])
            tests = []
            for task, other in zip(self.tests, others, strict=True):
                tests.append(joint.tested(other))
                write_test(tests[-1], task.folder)
                outcomes.append(outcome_of_test(task.name, tests[-1]))
                _tell(outcomes[-1])
            return self._end(joint, tests, outcomes, checkpoint)

    def _end(
        self,
        joint: JointFit,
        tests: Sequence[TestedScene],
        outcomes: Sequence[Outcome],
        checkpoint: Checkpoint,
    ) -> int:
        shared = [parameter_row(each) for each in joint.shared.values()]
        page = write_summary(self.folder, outcomes, TITLE, shared)
        write_joint_fit(joint, tests, self.folder, asked=checkpoint.asked)
        if joint.solution.interrupted:
            click.echo("the same command with --resume goes on")
        else:
            checkpoint.remove()
        click.echo(f"{page}")
        return EXIT_CODES[joint.state]


def _solved(
    scenes: Sequence[FittableScene],
    sharing: Sharing,
    interruption: Interruption,
    checkpoint: Checkpoint,
) -> JointFit:
    name = f"{len(scenes)} scene{'s' * (len(scenes) > 1)}"
    with fit_progress(name, scenes[0].settings.max_steps) as on_step:
        joint = joint_fit(
            scenes,
            sharing,
            on_step=interruption.after(on_step),
            stop=interruption,
            checkpoint=checkpoint,
        )
    click.echo(f"{name}: {joint.state} in {joint.phases.seconds['total']:.0f} s")
    if not joint.solution.converged:
        click.echo(f"  {joint.status}")
    return joint


def _fittable(inputs: FitInputs) -> FittableScene:
    return FittableScene.of(
        inputs.target,
        inputs.settings.fit,
        inputs.analysis,
        inputs.overrides,
        inputs.made_of.known,
    )


def _tell(outcome: Outcome) -> None:
    distances = ", ".join(
        f"C{band:02d} {w1:.3f}" for band, w1 in outcome.w1_over_std.items()
    )
    state = TESTED if outcome.state == TESTED else "fitted"
    click.echo(f"{outcome.name} {state}: W1 over std {distances}")
