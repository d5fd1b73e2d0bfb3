"""Which rays and steps to fit with, until a budget is spent."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from .quality import CHOICES, REFERENCE, FitQuality
from .trial import Fitted, FitTrial


@dataclass(frozen=True)
class FitSweep:
    """A `FitSweep` fits a subject again and again until a budget is spent.

    **Fields:**

    - `budget_s`: seconds; no fit begins that would end later, by those so far.
    - `reference`: that all others are compared with.
    - `choices`: in the order in which they are fitted.
    """

    budget_s: float
    reference: FitQuality = REFERENCE
    choices: Sequence[FitQuality] = CHOICES

    def trials(self, fitted: Callable[[FitQuality], Fitted]) -> Iterator[FitTrial]:
        """Yield the reference, which has no error, then each trial as it is measured.

        The reference and the first choice are measured whatever the budget; of the
        others those are left out that are too long for what is left.

        **Arguments:** `fitted`: fits with some rays and steps, such as `trial.fitted`
        of a subject.

        **Raises:** `DataError` where the reference determines no parameter.
        """
        end = time.perf_counter() + self.budget_s
        truth = fitted(self.reference)
        yield truth.against(truth)
        done = [truth]
        for choice in self.choices:
            late = time.perf_counter() + foreseen_s(choice, done) > end
            if late and len(done) > 1:
                continue
            done.append(fitted(choice))
            yield done[-1].against(truth)


def foreseen_s(quality: FitQuality, done: Sequence[Fitted]) -> float:
    """Foresee how long a fit takes that has yet to be compiled.

    As long as the one of the most similar work, of which solving grows with rays and
    steps, and as long as any to compile.
    """
    near = min(done, key=lambda one: abs(np.log(quality.work / one.quality.work)))
    solving = near.solve_s * quality.work / near.quality.work
    compiling = max(one.compiled_s for one in done)
    return compiling + near.seconds - near.solve_s + solving
