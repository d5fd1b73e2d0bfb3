"""What a fit's knobs cost and buy: python -m benchmarks.fit_trade -o DIR

Fits the scene that comes with the package with one choice of rays and steps after the
other, as `cloudjax tradeoff FOLDER --fit` does a folder's, and writes the front that
ships. Then it is fitted in double precision, in a process of its own: no choice of
`cloudjax fit`. All is written after each fit; prints the table of
docs/accuracy/speed.md.
"""

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from cloudjax_cli.held_memory import forget_if_much
from cloudjax_data.whole_files import write_text_whole
from cloudjax_fit import FitSettings, embedded_target
from cloudjax_fit.trade.fronts import FitFront
from cloudjax_fit.trade.measured import MeasuredFits
from cloudjax_fit.trade.quality import STANDARD
from cloudjax_fit.trade.sweep import FitSweep
from cloudjax_fit.trade.trial import FitSubject, Fitted, FitTrial, fitted
from cloudjax_scenes.trade.machine import Machine

from .parts import text


@dataclass(frozen=True)
class Row:
    """A fit of the table, and the floats that it was made with."""

    trial: FitTrial
    floats: str = "32 bit"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=Path("out/fit_trade"))
    parser.add_argument("--light", default="physical")
    parser.add_argument("--alone", action="store_true", help="prints one fit")
    asked = parser.parse_args()
    subject = package_subject(asked.light)
    if asked.alone:
        print(json.dumps(asdict(fitted(subject, STANDARD))))
        return
    asked.output.mkdir(parents=True, exist_ok=True)
    rows: list[Row] = []
    for row in measured(subject, asked.light):
        rows.append(row)
        _write(asked.output, subject, rows)
        print(table(rows).splitlines()[-1], flush=True)
    print(table(rows))


def package_subject(light: str) -> FitSubject:
    """Make a subject of the scene that comes with the package."""
    target = embedded_target()
    return FitSubject(target.imagery.name, target, FitSettings(light=light))


def measured(subject: FitSubject, light: str) -> Iterator[Row]:
    """Yield the reference, all choices of rays and steps, and double precision."""
    reference = None
    for trial in FitSweep(np.inf).trials(lambda quality: fitted(subject, quality)):
        reference = reference or trial.fitted
        forget_if_much()
        yield Row(trial)
    assert reference is not None
    yield Row(_doubled(light).against(reference), "64 bit")


def _doubled(light: str) -> Fitted:
    """Fit in a process of its own, whose precision is its own."""
    command = [sys.executable, "-m", "benchmarks.fit_trade", "--alone"]
    done = subprocess.run(
        [*command, "--light", light],
        env=os.environ | {"JAX_ENABLE_X64": "1"},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    return Fitted.of_json(json.loads(done.stdout.splitlines()[-1]))


def _write(folder: Path, subject: FitSubject, rows: Sequence[Row]) -> None:
    """The table, and the front under the name that it ships by."""
    write_text_whole(folder / "fit_trade.md", table(rows))
    front = front_of(subject, rows)
    file = folder / f"{front.kind}.json".replace(" ", "_")
    write_text_whole(file, json.dumps(front.json(), indent=1) + "\n")


def front_of(subject: FitSubject, rows: Sequence[Row]) -> FitFront:
    """Make a front of those fits that `cloudjax fit` may choose."""
    usual = [row.trial for row in rows if row.floats == "32 bit"]
    scene = MeasuredFits(
        subject.name, subject.outline, usual[0].fitted, tuple(usual[1:])
    )
    return FitFront(subject.outline.kind, Machine.here(), scene)


def table(rows: Sequence[Row]) -> str:
    """Write the fits as Markdown."""
    bands = list(rows[0].trial.fitted.w1_over_std)
    head = ["rays", "steps", "floats", "solver steps", "converged"]
    head += ["compile s", "other s", "of these to solve"]
    head += [f"W1/std C{number:02d}" for number in bands]
    head += ["shift, rms", "median", "most"]
    lines = []
    for row in rows:
        found, off = row.trial.fitted, np.abs(list(row.trial.shifts.values()))
        lines.append(
            [
                str(found.quality.rays),
                str(found.quality.steps),
                row.floats,
                str(found.solver_steps),
                "yes" if found.state == "converged" else "no",
                *(f"{s:.0f}" for s in (found.compiled_s, found.seconds, found.solve_s)),
                *(f"{found.w1_over_std[number]:.3f}" for number in bands),
                f"{row.trial.error:.2f}",
                f"{np.median(off):.2f}",
                f"{off.max():.1f}",
            ]
        )
    return text.table(head, lines)


if __name__ == "__main__":
    main()
