"""Which qualities to measure: each knob by itself first, then along the front.

What two knobs do together is not known before it is measured, but nearly: squares of
errors add, and factors of time multiply. So the front of all combinations is foreseen
from single knobs, and what is measured next is that part of it from which everything
measured is farthest.
"""

import itertools as it
import time
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, TypeVar

import numpy as np

from cloudjax import FractalCloud, Scene
from cloudjax_scenes.quality import REFERENCE, STANDARD, Quality

from .trial import Rendered, Subject, Trial


_STEPS = (6, 12, 24, 48)
_NODES = (1, 3, 5, 9)
# Towards the sun, of the reference; more hardly change an image (shadows.md).
_REFERENCE_SHADOWS = 12
# Points of the front that are nearer than this, in error and time, are as good as one.
_ALIKE = np.log(1.25)
# An error that is as good as none, for logarithms.
_LEAST_ERROR = 1e-5


Menu = Mapping[str, Sequence[Any]]
Choice = TypeVar("Choice", bound=Hashable)


def menu_of(scene: Scene) -> Menu:
    """List the values of those knobs that matter to a scene, from cheap to dear."""
    menu: dict[str, Sequence[Any]] = {"steps": _STEPS}
    if any(isinstance(layer.cloud, FractalCloud) for layer in scene.layers):
        menu["nodes"] = _NODES
    if scene.emission is not None:
        menu["scattering"] = (False, True)
    if scene.shadows is not None:
        steps = scene.shadows.steps
        menu["shadows"] = (*(n for n in (2, 3, 6) if n < steps), steps)
    return menu


@dataclass(frozen=True)
class Sweep:
    """A `Sweep` measures qualities of a subject until a budget is spent.

    **Fields:**

    - `menu`: values of the knobs that matter to the subject.
    - `budget_s`: seconds after which no trial begins that would last beyond it.
    - `standard`: the quality about which each knob is turned by itself.
    """

    budget_s: float
    menu: Menu
    standard: Quality = STANDARD
    reference: Quality = REFERENCE

    @staticmethod
    def of(subject: Subject, budget_s: float, *, shadows: int = 0) -> "Sweep":
        """Make the sweep for a subject, whose scenes have shadows of so many steps."""
        standard, reference = STANDARD, REFERENCE
        if shadows:
            standard = replace(standard, shadows=shadows)
            reference = replace(reference, shadows=max(shadows, _REFERENCE_SHADOWS))
        return Sweep(budget_s, menu_of(subject.scene(standard)), standard, reference)

    def trials(self, rendered: Callable[[Quality], Rendered]) -> Iterator[Trial]:
        """Yield the reference, which has no error, then each trial as it is measured.

        The reference and the standard are measured whatever the budget.

        **Arguments:** `rendered`: renders at a quality, such as `trial.rendered` of a
        subject.
        """
        end = time.perf_counter() + self.budget_s
        truth = rendered(self.reference)
        yield truth.against(truth)
        found: list[Trial] = []
        while True:
            chosen = self._next(found)
            if chosen is None or (found and not _fits(found, end)):
                return
            found.append(rendered(chosen).against(truth))
            yield found[-1]

    def _next(self, found: Sequence[Trial]) -> Quality | None:
        known = {trial.quality for trial in found}
        for quality in (self.standard, *self.singles()):
            if quality not in known:
                return quality
        return self._farthest(found)

    def singles(self) -> list[Quality]:
        """List the qualities that differ from the standard in one knob.

        The first value of every knob comes first: a short budget has seen each.
        """
        turned = [
            [replace(self.standard, **{name: value}) for value in values]
            for name, values in self.menu.items()
        ]
        every = it.chain.from_iterable(it.zip_longest(*turned))
        return [q for q in every if q is not None and q != self.standard]

    def _farthest(self, found: Sequence[Trial]) -> Quality | None:
        """Choose what is foreseen on the front and farthest from all measured."""
        foreseen = Foreseen.of(self.standard, found)
        combined = [
            replace(self.standard, **dict(zip(self.menu, values, strict=True)))
            for values in it.product(*self.menu.values())
        ]
        points = {quality: foreseen(quality) for quality in combined}
        measured = np.array([_place(t.seconds, t.error) for t in found])
        known = {trial.quality for trial in found}
        best, farthest = None, _ALIKE
        for quality in front(points):
            if quality not in known:
                apart = np.abs(measured - _place(*points[quality])).max(1).min()
                if apart > farthest:
                    best, farthest = quality, float(apart)
        return best


@dataclass(frozen=True)
class Foreseen:
    """`Foreseen` tells seconds and error of combinations from those of single knobs."""

    standard: Trial
    singles: Mapping[tuple[str, Any], Trial]

    @staticmethod
    def of(standard: Quality, found: Sequence[Trial]) -> "Foreseen":
        """Take out of what was measured the standard, and what differs in one knob."""
        singles = {}
        for trial in found:
            turned = asdict(trial.quality).items() - asdict(standard).items()
            if len(turned) == 1:
                singles[next(iter(turned))] = trial
        first = next(trial for trial in found if trial.quality == standard)
        return Foreseen(first, singles)

    def __call__(self, quality: Quality) -> tuple[float, float]:
        """Foresee seconds and error of a quality."""
        seconds, square = self.standard.seconds, self.standard.error**2
        for name, value in asdict(quality).items():
            single = self.singles.get((name, value))
            if single is not None:
                seconds *= single.seconds / self.standard.seconds
                square += single.error**2 - self.standard.error**2
        least = min([self.standard, *self.singles.values()], key=lambda t: t.error)
        return seconds, float(np.sqrt(max(square, least.error**2)))


def front(points: Mapping[Choice, tuple[float, float]]) -> list[Choice]:
    """List the choices that nothing beats in seconds and error, cheapest first."""
    best, kept = np.inf, []
    for choice in sorted(points, key=lambda one: points[one]):
        error = points[choice][1]
        if error < best:
            best = error
            kept.append(choice)
    return kept


def best_of(trials: Sequence[Any]) -> list[Any]:
    """List the trials that nothing beats in seconds and error, cheapest first.

    **Arguments:** `trials`: with `quality`, `seconds` and `error`, such as a `Trial`;
    of two of one quality the later one counts.
    """
    of = {trial.quality: trial for trial in trials}
    return [of[q] for q in front({q: (t.seconds, t.error) for q, t in of.items()})]


def _place(seconds: float, error: float) -> np.ndarray:
    return np.log([seconds, max(error, _LEAST_ERROR)])


def _fits(found: Sequence[Trial], end: float) -> bool:
    longest = max(trial.first_s for trial in found)
    return time.perf_counter() + longest < end
