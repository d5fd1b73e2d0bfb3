"""One trial: a scene fitted with some rays and steps, timed, and compared with a
reference.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from cloudjax import CloudClass
from cloudjax_data import DataError
from cloudjax_fit.fit_result import FitResult
from cloudjax_fit.fit_settings import FitSettings
from cloudjax_fit.fitting import fit
from cloudjax_fit.solver import OnStep
from cloudjax_fit.targets import Target
from cloudjax_scenes.trade.stopwatch import Stopwatch
from cloudjax_scenes.weather_analysis import Analysis

from .outline import FitOutline
from .quality import FitQuality


@dataclass(frozen=True, eq=False)
class FitSubject:
    """A `FitSubject` is what is fitted in trials.

    **Fields:** `name`: of the scene; the others as of `cloudjax_fit.fit`.
    """

    name: str
    target: Target
    settings: FitSettings
    analysis: Analysis | None = None
    overrides: Mapping[str, Mapping[str, Any]] | None = None
    classes: Mapping[str, CloudClass] | None = None

    @property
    def outline(self) -> FitOutline:
        """What is known of its fits before they begin."""
        return FitOutline.of(self.target, self.settings)


@dataclass(frozen=True)
class Estimated:
    """A parameter as a fit has found it.

    **Fields:** as of `Estimate` and its `Parameter`.
    """

    value: float
    std: float
    log: bool
    determined: bool

    @property
    def tells(self) -> bool:
        """Whether shifts can be told in its standard deviation."""
        numbers = np.isfinite(self.value) and np.isfinite(self.std)
        return bool(self.determined and numbers and self.std > 0)

    def shift(self, value: float) -> float:
        """Tell how far off another value is, in standard deviations of this one.

        Of a logarithmic parameter the relative change, in its relative deviation.
        """
        if self.log:
            return float(np.log(value / self.value) / (self.std / self.value))
        return (value - self.value) / self.std


@dataclass(frozen=True)
class Fitted:
    """What a fit with some rays and steps found, and what it took.

    **Fields:**

    - `state`, `solver_steps`: how it ended, and after how many steps of the solver.
    - `seconds`: of the whole fit, less those in which anything was compiled; of these
      `solve_s` of the solver and of the uncertainties.
    - `compiled_s`: in which functions were compiled.
    - `w1_over_std`: of the image with the fitted parameters, by band.
    - `estimates`: of the free parameters, by name.
    """

    quality: FitQuality
    state: str
    solver_steps: int
    seconds: float
    solve_s: float
    compiled_s: float
    w1_over_std: dict[int, float]
    estimates: dict[str, Estimated]

    @staticmethod
    def of(quality: FitQuality, found: FitResult, watch: Stopwatch) -> "Fitted":
        """Take what matters out of a result.

        **Arguments:** `watch`: that ran during the fit.
        """
        solving = found.seconds["solve"] + found.seconds["uncertainty"]
        return Fitted(
            quality=quality,
            state=found.state,
            solver_steps=len(found.history) - 1,
            seconds=watch.took_s,
            # Next to nothing is compiled meanwhile, but for a clock's sake.
            solve_s=min(solving, watch.took_s),
            compiled_s=watch.compiled_s,
            w1_over_std={n: d.w1_over_std for n, d in found.distances_fit.items()},
            estimates={
                e.parameter.name: Estimated(
                    e.value, e.std, e.parameter.log, e.determined
                )
                for e in found.estimates
            },
        )

    @classmethod
    def of_json(cls, data: Mapping[str, Any]) -> "Fitted":
        """Read what `dataclasses.asdict` and JSON made of one.

        **Raises:** `KeyError`, `TypeError` or `ValueError` for anything else.
        """
        distances = {int(n): w1 for n, w1 in data["w1_over_std"].items()}
        return cls(
            **{
                **data,
                "quality": FitQuality(**data["quality"]),
                "w1_over_std": distances,
                "estimates": {
                    name: Estimated(**one) for name, one in data["estimates"].items()
                },
            }
        )

    def against(self, reference: "Fitted") -> "FitTrial":
        """Compare with a fit that is taken for true.

        **Raises:** `DataError` where the reference determines no parameter.
        """
        wanted = {n: e for n, e in reference.estimates.items() if e.tells}
        if not wanted:
            raise DataError(
                "The data determine no parameter of the reference, by which others "
                "could be compared with it: take other bands or another scene."
            )
        shifts = {n: e.shift(self.estimates[n].value) for n, e in wanted.items()}
        return FitTrial(self, shifts)


@dataclass(frozen=True)
class FitTrial:
    """A `FitTrial` is what some rays and steps were measured to cost and to be worth.

    **Fields:**

    - `shifts`: of the parameters that the reference determines, by name, in its
      standard deviations.
    """

    fitted: Fitted
    shifts: dict[str, float]

    @property
    def quality(self) -> FitQuality:
        """The rays and steps."""
        return self.fitted.quality

    @property
    def seconds(self) -> float:
        """Those of the whole fit once compiled."""
        return self.fitted.seconds

    @property
    def error(self) -> float:
        """The root mean square of the shifts."""
        return float(np.sqrt(np.mean(np.square(list(self.shifts.values())))))

    @property
    def sound(self) -> bool:
        """Whether the fit has found numbers."""
        return bool(np.isfinite(self.error))

    def json(self) -> dict[str, Any]:
        """Return plain data, which `of_json` reads."""
        return asdict(self.fitted) | {"shifts": self.shifts, "error": self.error}

    @classmethod
    def of_json(cls, data: Mapping[str, Any]) -> "FitTrial":
        """Read what `json` gave.

        **Raises:** `KeyError`, `TypeError` or `ValueError` for anything else.
        """
        told = {k: v for k, v in data.items() if k not in ("shifts", "error")}
        return cls(Fitted.of_json(told), dict(data["shifts"]))


def fitted(
    subject: FitSubject, quality: FitQuality, on_step: OnStep | None = None
) -> Fitted:
    """Fit a subject with some rays and steps, and time it.

    **Arguments:** `on_step`: as of `cloudjax_fit.fit`.
    """
    watch = Stopwatch()
    with watch.running():
        found = fit(
            subject.target,
            subject.analysis,
            settings=quality.put_into(subject.settings),
            overrides=subject.overrides,
            classes=subject.classes,
            on_step=on_step,
        )
    return Fitted.of(quality, found, watch)
