"""How much cloud two sets of radiances show, and how cold and high its tops are.

Both are told by one rule: a difference is one of the clouds, and not of the rule.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from cloudjax_scenes.cloud_rule import CloudRule, default_rule
from cloudjax_scenes.daylight import shows_sunlit_clouds, sun_heights_deg

from .air_column import AirColumn
from .band_radiances import BandRadiances
from .common_pixels import common_pixels
from .plain_data import plain


# Of the temperatures of tops that are told.
SHARES = (0.05, 0.25, 0.5, 0.75, 0.95)
Bands = Mapping[int, BandRadiances]


@dataclass(frozen=True, eq=False)
class CloudsSeen:
    """`CloudsSeen` are those of one set of radiances.

    **Fields:**

    - `pixels`: how many have data in the bands of the rule.
    - `cover`: the share of them that is cloud.
    - `tops_k`: brightness temperatures of the cloud [K]; None without a window band.
    """

    pixels: int
    cover: float
    tops_k: Float[np.ndarray, " cloudy"] | None

    def top_k(self, share: float) -> float:
        """Return the temperature that this share of the tops is colder than, or NaN."""
        if self.tops_k is None or not self.tops_k.size:
            return np.nan
        return float(np.quantile(self.tops_k, share))


@dataclass(frozen=True, eq=False)
class CloudPair:
    """A `CloudPair` is what two sets of radiances show of clouds, by one rule.

    **Fields:** `air`: in which temperatures are heights.
    """

    rule: CloudRule
    air: AirColumn
    a: CloudsSeen
    b: CloudsSeen

    @property
    def sides(self) -> tuple[tuple[str, CloudsSeen], ...]:
        """Give both, with their letters."""
        return ("A", self.a), ("B", self.b)

    @property
    def shares(self) -> tuple[float, ...]:
        """Give the shares of the tops that are told."""
        return SHARES

    @property
    def window(self) -> str:
        """Name the band of the temperatures, or nothing."""
        band = self.rule.cold_band
        return "" if band is None else f"C{band:02d}"

    def top_m(self, seen: CloudsSeen, share: float) -> float:
        """Return the height [m] of the temperature of this share, or NaN."""
        return self.air.height_m(seen.top_k(share))

    def numbers(self) -> dict[str, Any]:
        """Return all of it as plain data; None stands for what is not known."""
        return {
            "rule": str(self.rule),
            "heights_by": self.air.words,
            **{
                side.lower(): {
                    "pixels": seen.pixels,
                    "cover": plain(seen.cover),
                    "top_k": _by_share(seen.top_k),
                    "top_m": _by_share(lambda s, seen=seen: self.top_m(seen, s)),
                }
                for side, seen in self.sides
            },
        }

    def words(self) -> list[str]:
        """Say the cover and the median top of both, a line each."""
        return [
            f"{side}: cover {seen.cover:.1%}{self._median(seen)}"
            for side, seen in self.sides
        ]

    def _median(self, seen: CloudsSeen) -> str:
        kelvin = seen.top_k(0.5)
        if np.isnan(kelvin):
            return ""
        return f", median top {kelvin:.1f} K at {self.top_m(seen, 0.5) / 1e3:.1f} km"


def clouds_of_both(a: Bands, b: Bands, air: AirColumn) -> CloudPair | None:
    """Find the clouds of both; None where the shared bands tell none from the ground.

    The rule is that of fits, `cloudjax_scenes.cloud_rule.default_rule`, of those bands
    whose reflectances or temperatures are known on both sides. A reflective band counts
    where the sun is known to be up in both.

    **Arguments:** `air`: by which temperatures of tops are heights.
    """
    shared = sorted(a.keys() & b.keys())
    known = [n for n in shared if a[n].is_known and b[n].is_known]
    day = all(_is_day(side[n]) for n in known[:1] for side in (a, b))
    try:
        rule = default_rule(known, day=day)
    except ValueError:
        return None
    if any(_together(rule, side) is None for side in (a, b)):
        # Its two bands are on unlike pixels: the one by night and day has to do.
        rule = replace(rule, bright_band=None, bright_reflectance=np.inf)
    return CloudPair(rule, air, _seen_by(rule, a), _seen_by(rule, b))


def _is_day(band: BandRadiances) -> bool:
    if band.grid is None or band.time is None:
        return False
    return shows_sunlit_clouds(sun_heights_deg(band.grid, band.time))


def _seen_by(rule: CloudRule, bands: Bands) -> CloudsSeen:
    of_rule = _together(rule, bands)
    assert of_rule is not None
    shown = {number: band.shown() for number, band in of_rule.items()}
    known = np.logical_and.reduce([np.isfinite(values) for values in shown.values()])
    of_pixels = {number: values[known] for number, values in shown.items()}
    cloud = rule.select(of_pixels, of_pixels)
    tops = None if rule.cold_band is None else of_pixels[rule.cold_band][cloud]
    count = int(known.sum())
    return CloudsSeen(count, float(cloud.mean()) if count else np.nan, tops)


def _together(rule: CloudRule, bands: Bands) -> Bands | None:
    """The bands of a rule on the same pixels, None where they have none in common."""
    numbers = [n for n in (rule.bright_band, rule.cold_band) if n is not None]
    chosen = [bands[number] for number in numbers]
    if len({band.values.shape for band in chosen}) > 1:
        images = _averaged(*chosen)
        if images is None:
            return None
        chosen = [
            replace(band, values=values)
            for band, values in zip(chosen, images, strict=True)
        ]
    return dict(zip(numbers, chosen, strict=True))


def _averaged(one: BandRadiances, other: BandRadiances):
    """The images of two bands on the coarser grid of both."""
    first, second = one.image(), other.image()
    if first is None or second is None or one.grid is None or other.grid is None:
        return None
    return common_pixels(first, one.grid, second, other.grid)


def _by_share(value: Callable[[float], float]) -> dict[str, float | None]:
    return {f"{share:g}": plain(value(share)) for share in SHARES}
