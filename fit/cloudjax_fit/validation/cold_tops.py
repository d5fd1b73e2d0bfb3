"""How cold the tops of the tropics are, above all where the analysis convects."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from cloudjax_fit.band_radiances import BandRadiances
from cloudjax_fit.histogram import sample_of
from cloudjax_fit.plain_data import plain


Pixels = Float[np.ndarray, " pixels"]
TROPICS_DEG = 23.5
COLD_K = 215.0
# The analysis convects where more of the sky than this is under deep convective cloud.
CONVECTS = 0.1
COLDEST = 0.05
# Windows of the air, the clearest first.
_WINDOWS = (13, 14, 15, 11)


@dataclass(frozen=True)
class ColdTops:
    """`ColdTops` are brightness temperatures in the window band between the tropics.

    **Fields:**

    - `band`: its number.
    - `cold_share`, `cold_where_convects`: of the area, colder than `COLD_K`: of the
      tropics, and of where the analysis convects.
    - `convects_share`: of the tropics, where it does.
    - `coldest_where_convects_k`: the temperature that the coldest 5 % there are below.
    - `coldest_elsewhere_k`: the same of the rest of the tropics.
    - `coldest_k`: of all pixels.

    NaN for shares and temperatures of no pixels.
    """

    band: int
    cold_share: float
    convects_share: float
    cold_where_convects: float
    coldest_where_convects_k: float
    coldest_elsewhere_k: float
    coldest_k: float

    def numbers(self) -> dict[str, Any]:
        """Return all of it as plain data; None stands for what is not known."""
        return plain(asdict(self))


def window_band(bands: Mapping[int, BandRadiances]) -> int | None:
    """Return the number of the clearest window whose temperatures are known."""
    return next((n for n in _WINDOWS if n in bands and bands[n].is_known), None)


def cold_tops(
    band: int,
    kelvin: Pixels,
    convection: Pixels,
    latitude_deg: Pixels,
    area_m2: Pixels,
) -> ColdTops | None:
    """Find the coldest tops of the tropics; None for an image that sees none of them.

    **Arguments:** `convection`: fraction of the sky under deep convective cloud, by the
    analysis.
    """
    tropics = (np.abs(latitude_deg) <= TROPICS_DEG) & np.isfinite(kelvin)
    if not tropics.any():
        return None
    k, of, convects = kelvin[tropics], area_m2[tropics], convection[tropics] > CONVECTS
    return ColdTops(
        band=band,
        cold_share=_share(k < COLD_K, of),
        convects_share=_share(convects, of),
        cold_where_convects=_share((k < COLD_K)[convects], of[convects]),
        coldest_where_convects_k=_coldest(k[convects], of[convects]),
        coldest_elsewhere_k=_coldest(k[~convects], of[~convects]),
        coldest_k=float(k.min()),
    )


def _share(is_so, area_m2: Pixels) -> float:
    return float(np.average(is_so, weights=area_m2)) if area_m2.size else math.nan


def _coldest(kelvin: Pixels, area_m2: Pixels) -> float:
    return sample_of(kelvin, area_m2).quantile(COLDEST) if kelvin.size else math.nan
