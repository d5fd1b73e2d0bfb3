"""A scene whose qualities have been measured, and what it lets expect of another."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cloudjax.light.bands import nominal_bands

from .outline import Outline
from .sweep import best_of
from .trial import Trial


# A band adds this much to the time that a march takes without light: sectors of 1 to 2
# km took 26 us a pixel with two bands, and 45 to 60 with five, one of them sunlit and
# thermal (2 cores, `rendered` at the standard quality).
_SUNLIT_S, _THERMAL_S = 0.25, 0.25


@dataclass(frozen=True)
class Measured:
    """A scene whose qualities have been measured.

    **Fields:**

    - `name`: of what was rendered; `outline`: of it.
    - `sample`: pixels that were rendered.
    - `reference`: the quality that was taken for true.
    - `trials`: all of them, in the order in which they were measured.
    """

    name: str
    outline: Outline
    sample: int
    reference: Trial
    trials: Sequence[Trial]

    @property
    def best(self) -> list[Trial]:
        """The trials that nothing beats in seconds and error, cheapest first."""
        return best_of(self.trials)

    def told_of(self, trial: Trial, other: Outline) -> tuple[float, float]:
        """Return the seconds and the error that a trial lets expect of another scene.

        A band that was not measured is like the measured one nearest in wavelength.
        """
        share = (
            other.pixels / self.outline.pixels * _light(other) / _light(self.outline)
        )
        seconds = trial.fixed_s + (trial.seconds - trial.fixed_s) * share
        known = {self._nearest(number) for number in other.bands}
        return seconds, max(trial.errors[number].rmse for number in known)

    def _nearest(self, number: int) -> int:
        every = nominal_bands()
        wanted = np.log(every[number].wavelength_um)
        measured = self.outline.bands
        return min(measured, key=lambda n: abs(np.log(every[n].wavelength_um) - wanted))


def _light(outline: Outline) -> float:
    """The time that bands take, in that of a march without light."""
    bands = [nominal_bands()[number] for number in outline.bands]
    sunlit = sum(b.reflective or (b.sunlit and outline.kind.sunlit) for b in bands)
    thermal = sum(not b.reflective for b in bands)
    return 1 + _SUNLIT_S * sunlit + _THERMAL_S * thermal
