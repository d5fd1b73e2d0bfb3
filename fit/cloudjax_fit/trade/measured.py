"""A scene whose fits have been measured, and what they let expect of another."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from cloudjax_scenes.trade.sweep import best_of

from .outline import FitKind, FitOutline
from .trial import Fitted, FitTrial


@dataclass(frozen=True)
class MeasuredFits:
    """A scene whose fits have been measured.

    **Fields:**

    - `name`: of the scene; `outline`: of its fits.
    - `reference`: the fit that was taken for true.
    - `trials`: all others, in the order in which they were measured.
    """

    name: str
    outline: FitOutline
    reference: Fitted
    trials: Sequence[FitTrial]

    @property
    def best(self) -> list[FitTrial]:
        """The trials that nothing beats in seconds and error, quickest first."""
        return best_of(self.trials)

    def seconds_of(self, trial: FitTrial, other: FitOutline) -> float:
        """Return the seconds that a trial lets expect of another fit.

        All of them grow with bands, those of the solver with starts, and the others
        with the pixels of the two images that are rendered.
        """
        own = self.outline
        bands = len(other.bands) / len(own.bands)
        solving = trial.fitted.solve_s * other.starts / own.starts
        rest = (trial.seconds - trial.fitted.solve_s) * other.pixels / own.pixels
        return bands * (solving + rest)

    def json(self) -> dict[str, Any]:
        """Return plain data, which `of_json` reads."""
        return {
            "name": self.name,
            "outline": asdict(self.outline),
            "reference": asdict(self.reference),
            "trials": [trial.json() for trial in self.trials],
            "front": [trial.quality.words for trial in self.best],
        }

    @classmethod
    def of_json(cls, data: dict[str, Any]) -> "MeasuredFits":
        """Read what `json` gave.

        **Raises:** `KeyError`, `TypeError` or `ValueError` for anything else.
        """
        outline = data["outline"]
        own = {"kind": FitKind(**outline["kind"]), "bands": tuple(outline["bands"])}
        return cls(
            data["name"],
            FitOutline(**outline | own),
            Fitted.of_json(data["reference"]),
            tuple(map(FitTrial.of_json, data["trials"])),
        )
