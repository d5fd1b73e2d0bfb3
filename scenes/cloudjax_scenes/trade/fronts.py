"""Fronts: the qualities that nothing beats, kept in files and chosen from.

A front is of one kind of scene, one machine and one version, measured of one scene or
of several. Those that ship are of the machine that docs/accuracy/speed.md names;
`cloudjax tradeoff` measures others.
"""

import functools as ft
import importlib.resources
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import platformdirs

import cloudjax
from cloudjax_data import DataError
from cloudjax_data.whole_files import write_text_whole
from cloudjax_scenes.quality import Quality

from .machine import Machine
from .measured import Measured
from .outline import Kind, Outline
from .sweep import front
from .trial import BandError, Trial


@dataclass(frozen=True)
class Expected:
    """What is `Expected` of a quality: the greatest error of a band, and seconds."""

    quality: Quality
    seconds: float
    error: float


@dataclass(frozen=True)
class Front:
    """A `Front` is what was measured of one kind of scenes on one machine.

    **Fields:** `scenes`: one or more.
    """

    kind: Kind
    machine: Machine
    scenes: Sequence[Measured]
    version: str = field(default_factory=lambda: cloudjax.__version__)

    def expected(self, outline: Outline) -> list[Expected]:
        """Expect of a scene on this machine what nothing beats, cheapest first.

        Scenes measured with pixels like its own count most. Their seconds and errors
        are averaged as factors.
        """
        faster = Machine.here().work_s / self.machine.work_s
        octaves = [
            np.log2(scene.outline.pixel_m / outline.pixel_m) for scene in self.scenes
        ]
        weights = 1 / (1 + np.square(octaves))
        points = {}
        for quality, trials in self._of_all().items():
            told = [
                scene.told_of(trial, outline)
                for scene, trial in zip(self.scenes, trials, strict=True)
            ]
            logs = np.log(np.maximum(told, _LEAST))
            seconds, error = np.exp(np.average(logs, axis=0, weights=weights))
            points[quality] = float(seconds * faster), float(error)
        return [Expected(quality, *points[quality]) for quality in front(points)]

    @property
    def qualities(self) -> tuple[Quality, ...]:
        """Those that were measured of every scene."""
        return tuple(self._of_all())

    def _of_all(self) -> dict[Quality, list[Trial]]:
        """The qualities that were measured of every scene."""
        of_each = [{t.quality: t for t in scene.trials} for scene in self.scenes]
        common = [q for q in of_each[0] if all(q in known for known in of_each)]
        return {q: [known[q] for known in of_each] for q in common}

    def within_error(self, error: float, outline: Outline) -> Expected:
        """Choose the cheapest quality of which no greater error is expected.

        **Raises:** `DataError` where none is as good.
        """
        expected = self.expected(outline)
        good = [one for one in expected if one.error <= error]
        if not good:
            raise DataError(
                f"No quality that was measured errs by less than "
                f"{expected[-1].error:.2%} in scenes of {self.kind}: allow that, or "
                "use --quality reference."
            )
        return good[0]

    def within_seconds(self, seconds: float, outline: Outline) -> Expected:
        """Choose the best quality that is expected to take no longer.

        **Raises:** `DataError` where none is as quick.
        """
        expected = self.expected(outline)
        quick = [one for one in expected if one.seconds <= seconds]
        if not quick:
            raise DataError(
                f"The cheapest quality takes {expected[0].seconds:.2g} s for "
                f"{outline.pixels} pixels here: allow that, or choose a sensor of "
                "coarser pixels."
            )
        return quick[-1]

    def json(self) -> dict[str, Any]:
        """Return plain data, which `of_json` reads."""
        found = asdict(self)
        for data, scene in zip(found["scenes"], self.scenes, strict=True):
            data["front"] = [trial.quality.words for trial in scene.best]
        return found

    @classmethod
    def of_json(cls, data: dict[str, Any]) -> "Front":
        """Read what `json` gave.

        **Raises:** `KeyError`, `TypeError` or `ValueError` for anything else.
        """
        return cls(
            Kind(**data["kind"]),
            Machine(**data["machine"]),
            tuple(map(_measured, data["scenes"])),
            data["version"],
        )


# For logarithms of seconds and errors.
_LEAST = 1e-6
# Less to choose from is no front.
_LEAST_QUALITIES = 3


def _measured(data: dict[str, Any]) -> Measured:
    known = {key: value for key, value in data.items() if key != "front"}
    outline = known["outline"]
    return Measured(
        **known
        | {
            "outline": Outline(
                **outline
                | {"kind": Kind(**outline["kind"]), "bands": tuple(outline["bands"])}
            ),
            "reference": _trial(known["reference"]),
            "trials": tuple(map(_trial, known["trials"])),
        }
    )


def _trial(data: dict[str, Any]) -> Trial:
    errors = {int(number): BandError(**e) for number, e in data["errors"].items()}
    return Trial(**data | {"quality": Quality(**data["quality"]), "errors": errors})


# Where fronts are kept ----------------------------------------------------------------


def own_file(kind: object) -> Path:
    """Return where this machine keeps its own front of a kind, for this version.

    **Arguments:** `kind`: told from others by its words, such as a `Kind`.
    """
    folder = platformdirs.user_data_path("cloudjax") / "fronts" / cloudjax.__version__
    return folder / f"{Machine.here().name}, {kind}.json".replace(" ", "_")


def keep(front: Front) -> Path | None:
    """Keep a front for later renders on this machine, and return its file.

    One that leaves little to choose is not kept, nor one of fewer qualities than are
    kept already.
    """
    file = own_file(front.kind)
    known = len(read_front(file).qualities) if file.exists() else 0
    if len(front.qualities) < max(known, _LEAST_QUALITIES):
        return None
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


def front_for(kind: Kind) -> tuple[Front, str]:
    """Find a front that serves a kind of scene, and say where it is from.

    The machine's own goes before the one that ships.

    **Raises:** `DataError` where there is none.
    """
    file = own_file(kind)
    if file.exists():
        return read_front(file), str(file)
    for shipped in _shipped():
        if shipped.kind.serves(kind):
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
