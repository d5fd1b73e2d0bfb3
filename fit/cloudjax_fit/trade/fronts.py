"""Fronts of fits: the rays and steps that nothing beats, kept in files and chosen from.

A front is of one kind of fit, one machine and one version, measured of one scene. Those
that ship are of the machine that docs/accuracy/speed.md names; others are measured by
`cloudjax tradeoff --fit`.
"""

import functools as ft
import importlib.resources
import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import cloudjax
from cloudjax_data import DataError
from cloudjax_data.whole_files import write_text_whole
from cloudjax_scenes.trade.fronts import own_file
from cloudjax_scenes.trade.machine import Machine

from .measured import MeasuredFits
from .outline import FitKind, FitOutline
from .quality import FitQuality


@dataclass(frozen=True)
class ExpectedFit:
    """What is expected of rays and steps: seconds, and the shift of the parameters."""

    quality: FitQuality
    seconds: float
    error: float


@dataclass(frozen=True)
class FitFront:
    """A `FitFront` is what was measured of fits of one scene on one machine."""

    kind: FitKind
    machine: Machine
    scene: MeasuredFits
    version: str = field(default_factory=lambda: cloudjax.__version__)

    def expected(self, outline: FitOutline) -> list[ExpectedFit]:
        """Expect of a fit on this machine what nothing beats, quickest first."""
        faster = Machine.here().work_s / self.machine.work_s
        return [
            ExpectedFit(
                trial.quality,
                faster * self.scene.seconds_of(trial, outline),
                trial.error,
            )
            for trial in self.scene.best
        ]

    def within_error(self, error: float, outline: FitOutline) -> ExpectedFit:
        """Choose the quickest rays and steps of which no greater error is expected.

        **Raises:** `DataError` where none are as good.
        """
        expected = self.expected(outline)
        good = [one for one in expected if one.error <= error]
        if not good:
            raise DataError(
                "No rays and steps that were measured move parameters by less than "
                f"{expected[-1].error:.0%} of their deviation in {self.kind}: allow "
                "that, or use --quality reference."
            )
        return good[0]

    def within_seconds(self, seconds: float, outline: FitOutline) -> ExpectedFit:
        """Choose the best rays and steps that are expected to take no longer.

        **Raises:** `DataError` where none are as quick.
        """
        expected = self.expected(outline)
        quick = [one for one in expected if one.seconds <= seconds]
        if not quick:
            raise DataError(
                f"The quickest fit that was measured takes {expected[0].seconds:.2g} s "
                f"for such a scene here: allow that, or give --rays and --steps."
            )
        return quick[-1]

    def json(self) -> dict[str, Any]:
        """Return plain data, which `of_json` reads."""
        return {
            "kind": asdict(self.kind),
            "machine": asdict(self.machine),
            "scene": self.scene.json(),
            "version": self.version,
        }

    @classmethod
    def of_json(cls, data: dict[str, Any]) -> "FitFront":
        """Read what `json` gave.

        **Raises:** `KeyError`, `TypeError` or `ValueError` for anything else.
        """
        return cls(
            FitKind(**data["kind"]),
            Machine(**data["machine"]),
            MeasuredFits.of_json(data["scene"]),
            data["version"],
        )


# Where fronts are kept ----------------------------------------------------------------


# Less to choose from is no front.
_LEAST_CHOICES = 3


def keep(front: FitFront) -> Path | None:
    """Keep a front for later fits on this machine, and return its file.

    One that leaves little to choose is not kept, nor one of fewer trials than are kept
    already.
    """
    file = own_file(front.kind)
    known = len(read_front(file).scene.trials) if file.exists() else 0
    if len(front.scene.trials) < max(known, _LEAST_CHOICES):
        return None
    file.parent.mkdir(parents=True, exist_ok=True)
    write_text_whole(file, json.dumps(front.json(), indent=1) + "\n")
    return file


def read_front(file: Path) -> FitFront:
    """Read a front from a file.

    **Raises:** `DataError` for a file that holds none.
    """
    try:
        return FitFront.of_json(json.loads(file.read_text(encoding="utf-8")))
    except (OSError, KeyError, TypeError, ValueError, AttributeError) as error:
        raise DataError(
            f"{file} is no front of this version ({error}): remove it, or measure it "
            "anew with cloudjax tradeoff --fit."
        ) from error


def front_for(kind: FitKind) -> tuple[FitFront, str]:
    """Find a front that serves a kind of fit, and say where it is from.

    The machine's own goes before the one that ships.

    **Raises:** `DataError` where there is none.
    """
    file = own_file(kind)
    if file.exists():
        return read_front(file), str(file)
    for shipped in _shipped():
        if shipped.kind == kind:
            return shipped, f"shipped, {shipped.machine.name}"
    raise DataError(
        f"No front of {kind} is known: measure it with cloudjax tradeoff FOLDER --fit, "
        "or give --quality."
    )


@ft.cache
def _shipped() -> tuple[FitFront, ...]:
    folder = importlib.resources.files("cloudjax_fit.trade") / "fronts"
    # An empty folder is in no package.
    files = folder.iterdir() if folder.is_dir() else ()
    return tuple(
        FitFront.of_json(json.loads(file.read_text(encoding="utf-8")))
        for file in files
        if file.name.endswith(".json")
    )
