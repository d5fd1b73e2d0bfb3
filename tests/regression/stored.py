"""Numbers that were stored, and what has moved since."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np


FOLDER = Path(__file__).parent / "stored"
# Of a number that is stored: float32 has no more.
DIGITS = 7

Numbers = Mapping[str, np.ndarray | float]


@dataclass(frozen=True)
class Move:
    """An entry that is not what it was, and in words how far it went."""

    name: str
    words: str

    def __str__(self) -> str:
        return f"{self.name} {self.words}"


@dataclass
class Stored:
    """The stored results of all tests, compared with new ones or replaced by them.

    **Fields:** `update`: whether to replace; `news`: lines for the end of the run.
    """

    update: bool
    news: list[str] = field(default_factory=list)

    def check(self, name: str, found: Numbers, allowed: Numbers) -> None:
        """Compare what was found with what is stored under a name, or store it.

        `allowed` is what rounding may change of each entry.
        """
        file = FOLDER / f"{name}.json"
        moved = moves(read(file), found, allowed)
        if not self.update:
            text = f"{file.name}: {'; '.join(map(str, moved))}."
            assert not moved, f"{text} tests/regression/README.md says what to do."
            return
        self.news += [f"{name}: {move}" for move in moved] or [f"{name}: stays"]
        if moved:
            write(file, found)


def share(numbers: Numbers, part: float) -> dict[str, float]:
    """An allowance for each entry: a part of its largest value."""
    return {name: part * _largest(np.asarray(value)) for name, value in numbers.items()}


def moves(old: Numbers, new: Numbers, allowed: Numbers) -> list[Move]:
    """Entries that went farther than allowed, came or left."""
    found = []
    for name in sorted({*old, *new}):
        if name not in old or name not in new:
            words = "is new" if name in new else "is gone"
        else:
            before, after = (np.asarray(side[name], float) for side in (old, new))
            words = _moved(before, after, float(allowed[name]))
        if words is not None:
            found.append(Move(name, words))
    return found


def _moved(old: np.ndarray, new: np.ndarray, allowed: float) -> str | None:
    if old.shape != new.shape:
        return f"changed its shape from {old.shape} to {new.shape}"
    if not np.array_equal(np.isfinite(old), np.isfinite(new)):
        return "is finite elsewhere"
    distance, largest = _largest(old - new), _largest(old)
    if distance <= allowed:
        return None
    part = distance / largest if largest else np.inf
    return (
        f"moved by {distance:.3g} ({part:.1e} of its largest value; rounding may move "
        f"it by {allowed:.2g})"
    )


def _largest(values: np.ndarray) -> float:
    finite = np.abs(values[np.isfinite(values)])
    return float(finite.max(initial=0.0))


def read(file: Path) -> dict[str, np.ndarray]:
    if not file.is_file():
        return {}
    numbers = json.loads(file.read_text(encoding="utf-8"))
    return {name: np.array(value, float) for name, value in numbers.items()}


def write(file: Path, numbers: Numbers) -> None:
    """One line for each entry, so that a diff shows what moved; NaN as null."""
    lines = [
        f"{json.dumps(name)}: {json.dumps(_plain(np.asarray(value).tolist()))}"
        for name, value in sorted(numbers.items())
    ]
    file.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


def _plain(value):
    if isinstance(value, list):
        return [_plain(item) for item in value]
    return float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None
