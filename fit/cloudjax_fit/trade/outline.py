"""What is known of a fit before it begins, by which a front is chosen and read."""

from dataclasses import dataclass

import numpy as np

from cloudjax_fit.fit_settings import FitSettings
from cloudjax_fit.targets import Target


@dataclass(frozen=True)
class FitKind:
    """A `FitKind` is what one front serves.

    **Fields:** `light`, `statistics`: as of `FitSettings`.
    """

    light: str
    statistics: str

    def __str__(self) -> str:
        return f"fits in {self.light} light by {self.statistics}"

    @staticmethod
    def of(settings: FitSettings) -> "FitKind":
        """Tell the kind of a fit."""
        return FitKind(settings.light, settings.statistics)


@dataclass(frozen=True)
class FitOutline:
    """A `FitOutline` is what is known of a fit before it begins.

    **Fields:**

    - `bands`: ABI numbers.
    - `pixels`: of the scene.
    - `starts`: as of `FitSettings`.
    """

    kind: FitKind
    bands: tuple[int, ...]
    pixels: int
    starts: int

    @staticmethod
    def of(target: Target, settings: FitSettings) -> "FitOutline":
        """Outline the fit of a target."""
        return FitOutline(
            FitKind.of(settings),
            tuple(target.imagery.bands),
            int(np.prod(target.imagery.grid.shape)),
            settings.starts,
        )
