"""Fronts: the qualities that nothing beats, kept in files and chosen from.

A front is of one kind of scene, one machine and one version. One ships for each kind,
of the machine that docs/accuracy/speed.md names; `cloudjax tradeoff` measures others.
"""

import functools as ft
import importlib.resources
import json
import os
import platform
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import platformdirs

import cloudjax
from cloudjax_data import DataError
from cloudjax_data.whole_files import write_text_whole
from cloudjax_scenes.quality import Quality

from .sweep import front
from .trial import BandError, Trial


@dataclass(frozen=True)
class Machine:
    """A `Machine` is what times are of.

    **Fields:**

    - `name`: its cores and its processor.
    - `work_s`: that a piece of work takes there which is like a render's, for times of
      one machine to be told on another.
    """

    name: str
    work_s: float

    @staticmethod
    @ft.cache
    def here() -> "Machine":
        """Name this machine, and time the piece of work."""
        device = jax.devices()[0]
        kind = platform.machine() if device.platform == "cpu" else device.device_kind
        return Machine(f"{os.cpu_count()} cores, {kind}", _work_s())


def _work_s() -> float:
    """Exponentials and sums over tables that a cache holds, as in the march."""

    @jax.jit
    def work(x):
        for _ in range(8):
            x = jnp.exp(-jnp.abs(x)) @ jnp.full((64, 64), 1 / 64, x.dtype)
        return x

    start = jnp.linspace(0, 1, 1 << 20, dtype=jnp.float32).reshape(-1, 64)
    work(start).block_until_ready()
    took = []
    for _ in range(5):
        began = time.perf_counter()
        work(start).block_until_ready()
        took.append(time.perf_counter() - began)
    return min(took)


@dataclass(frozen=True)
class Front:
    """A `Front` is what was measured of one kind of scene on one machine.

    **Fields:**

    - `kind`: of scene, see `subjects.py`.
    - `subjects`: names of what was rendered.
    - `pixels`: of the whole image, for which seconds are told.
    - `sample`: pixels that were rendered.
    - `reference`: the quality that was taken for true.
    - `trials`: all of them, in the order in which they were measured.
    """

    kind: str
    subjects: Sequence[str]
    pixels: int
    sample: int
    machine: Machine
    reference: Trial
    trials: Sequence[Trial]
    version: str = field(default_factory=lambda: cloudjax.__version__)

    @property
    def best(self) -> list[Trial]:
        """The trials that nothing beats in seconds and error, cheapest first."""
        of = {trial.quality: trial for trial in self.trials}
        return [of[q] for q in front({q: (t.seconds, t.error) for q, t in of.items()})]

    def within_error(self, error: float) -> Trial:
        """Choose the cheapest quality whose error is no greater.

        **Raises:** `DataError` where none is as good.
        """
        good = [trial for trial in self.best if trial.error <= error]
        if not good:
            least = self.best[-1].error
            raise DataError(
                f"No quality that was measured errs by less than {least:.2%} in scenes "
                f"of {self.kind}: allow that, or use --quality reference."
            )
        return good[0]

    def within_seconds(self, seconds: float, pixels: int) -> Trial:
        """Choose the best quality that takes no longer for so many pixels.

        **Raises:** `DataError` where none is as quick.
        """
        quick = [t for t in self.best if self.expected_s(t, pixels) <= seconds]
        if not quick:
            least = self.expected_s(self.best[0], pixels)
            raise DataError(
                f"The cheapest quality takes {least:.2g} s for {pixels} pixels here: "
                "allow that, or choose a sensor of coarser pixels."
            )
        return quick[-1]

    def expected_s(self, trial: Trial, pixels: int) -> float:
        """Expect of a trial's seconds those for so many pixels on this machine."""
        faster = Machine.here().work_s / self.machine.work_s
        return trial.seconds * pixels / self.pixels * faster

    def json(self) -> dict[str, Any]:
        """Return plain data, which `of_json` reads."""
        return asdict(self) | {"front": [t.quality.words for t in self.best]}

    @classmethod
    def of_json(cls, data: dict[str, Any]) -> "Front":
        """Read what `json` gave.

        **Raises:** `KeyError`, `TypeError` or `ValueError` for anything else.
        """
        known = {key: value for key, value in data.items() if key != "front"}
        return cls(
            **known
            | {
                "machine": Machine(**data["machine"]),
                "reference": _trial(data["reference"]),
                "trials": tuple(map(_trial, data["trials"])),
            }
        )


def _trial(data: dict[str, Any]) -> Trial:
    errors = {int(number): BandError(**e) for number, e in data["errors"].items()}
    return Trial(**data | {"quality": Quality(**data["quality"]), "errors": errors})


# Where fronts are kept ----------------------------------------------------------------


def own_file(kind: str) -> Path:
    """Return where this machine keeps its own front of a kind, for this version."""
    folder = platformdirs.user_data_path("cloudjax") / "fronts" / cloudjax.__version__
    return folder / f"{Machine.here().name}, {kind}.json".replace(" ", "_")


def keep(front: Front) -> Path:
    """Keep a front for later renders on this machine, and return its file."""
    file = own_file(front.kind)
    file.parent.mkdir(parents=True, exist_ok=True)
    write_text_whole(file, json.dumps(front.json(), indent=1) + "\n")
    return file


def read_front(file: Path) -> Front:
    """Read a front from a file.

    **Raises:** `DataError` for a file that holds none.
    """
    try:
        return Front.of_json(json.loads(file.read_text(encoding="utf-8")))
    except (OSError, KeyError, TypeError, ValueError, DataError) as error:
        raise DataError(
            f"{file} is no front of this version ({error}): remove it, or measure it "
            "anew with cloudjax tradeoff."
        ) from error


def front_for(kind: str) -> tuple[Front, str]:
    """Find the front for a kind of scene, and say where it is from.

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
        f"No front for scenes of {kind} ships: measure it with cloudjax tradeoff, or "
        "give --quality."
    )


@ft.cache
def _shipped() -> tuple[Front, ...]:
    folder = importlib.resources.files("cloudjax_scenes.trade") / "fronts"
    return tuple(
        Front.of_json(json.loads(file.read_text(encoding="utf-8")))
        for file in folder.iterdir()
    )
