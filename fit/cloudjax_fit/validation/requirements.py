"""What an Earth that could be a satellite's has to meet, and whether an image does."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from cloudjax_fit.plain_data import plain

from .cold_tops import COLD_K, ColdTops
from .cover import KINDS, Covers
from .spectra import SHALLOW, STEEP, RowSpectrum


MOST_POINTS = 5.0
LEAST_CORRELATION = 0.8


@dataclass(frozen=True)
class Requirement:
    """A `Requirement` is what an image has to meet, and the number that it has.

    **Fields:**

    - `what`: is measured; `wanted`: in words; `found`: with its unit.
    - `value`: NaN where the image does not tell.
    - `low`, `high`: between which it has to be.
    """

    what: str
    wanted: str
    found: str
    value: float
    low: float
    high: float

    @property
    def met(self) -> bool | None:
        """Tell whether it is met; None where that is not known."""
        return None if math.isnan(self.value) else self.low <= self.value <= self.high

    @property
    def verdict(self) -> str:
        """Say it in a word or two."""
        return {True: "met", False: "missed", None: "not told"}[self.met]

    @property
    def words(self) -> str:
        """Say all of it in a sentence."""
        return f"{self.what}: {self.found}, wanted {self.wanted}: {self.verdict}."

    def numbers(self) -> dict[str, Any]:
        """Return all of it as plain data; None stands for what is not known."""
        return {
            "what": self.what,
            "wanted": self.wanted,
            "value": plain(self.value),
            "met": self.met,
        }


def requirements_of(
    covers: Covers, tops: ColdTops | None, spectra: Mapping[str, RowSpectrum]
) -> list[Requirement]:
    """Judge an image: covers, patterns, anvils, and the spectrum of each band."""
    points = [
        Requirement(
            f"{_named(kind)}, image less analysis",
            f"within {MOST_POINTS:g} points",
            _number(covers.whole[kind].points, "+.1f", " points"),
            covers.whole[kind].points,
            -MOST_POINTS,
            MOST_POINTS,
        )
        for kind in KINDS
    ]
    patterns = [
        Requirement(
            f"{_named(kind)}, pattern correlation at 2.5 degrees",
            f"at least {LEAST_CORRELATION:g}",
            _number(covers.correlation[kind], ".2f"),
            covers.correlation[kind],
            LEAST_CORRELATION,
            1.0 + 1e-9,
        )
        for kind in KINDS
    ]
    kelvin = math.nan if tops is None else tops.coldest_where_convects_k
    anvils = Requirement(
        "coldest 5 % of tropical pixels where the analysis convects",
        f"colder than {COLD_K:g} K",
        _number(kelvin, ".1f", " K"),
        kelvin,
        0.0,
        math.nextafter(COLD_K, 0.0),
    )
    slopes = [
        Requirement(
            f"slope of the spectrum of {name}",
            "between −3 and −5/3",
            _number(one.slope, ".2f"),
            one.slope,
            STEEP,
            SHALLOW,
        )
        for name, one in spectra.items()
    ]
    return [*points, *patterns, anvils, *slopes]


def _named(kind: str) -> str:
    return "total cover" if kind == "total" else f"{kind} cloud as seen"


def _number(value: float, form: str, unit: str = "") -> str:
    if math.isnan(value):
        return "not known"
    return f"{value:{form}}{unit}".replace("-", "−")
