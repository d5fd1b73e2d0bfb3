"""An image beside the analysis by which it was rendered: all that is compared."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from cloudjax_data import WeatherCube
from cloudjax_fit.band_radiances import BandRadiances

from .cold_tops import ColdTops, cold_tops, window_band
from .cover import Covers, class_covers, compare_covers, seen_covers
from .isccp import CloudTypes, cloud_types
from .requirements import Requirement, requirements_of
from .seen_earth import MOST_STRETCH, SeenEarth
from .spectra import FinestPart, RowSpectrum, finest_part, row_spectrum
from .told_sky import check_close, held_pixels, told_sky, top_pressures_hpa


# Of a pixel: less cloud is clear, more is cloudy.
CLEAR_BELOW, CLOUDY_ABOVE = 0.1, 0.9


@dataclass(frozen=True, eq=False)
class SplitBand:
    """A `SplitBand` has the pixels of a band that are clear, and that are cloudy.

    **Fields:**

    - `name`, `words`: such as "C13", and "brightness temperature (K)".
    - `clear`, `cloudy`: reflectance factors, temperatures or, where their meaning is
      not known, radiances.
    - `spectrum`: of rows near the sub-satellite point, None where they are few.
    """

    name: str
    words: str
    clear: Float[np.ndarray, " clear"]
    cloudy: Float[np.ndarray, " cloudy"]
    spectrum: RowSpectrum | None

    def numbers(self) -> dict[str, Any]:
        """Return counts, means and the spectrum as plain data."""
        return {
            "quantity": self.words,
            "clear": _summary(self.clear),
            "cloudy": _summary(self.cloudy),
            "spectrum": None if self.spectrum is None else self.spectrum.numbers(),
        }


@dataclass(frozen=True, eq=False)
class Validation:
    """A `Validation` is all that is compared of an image and an analysis.

    **Fields:**

    - `facts`: shown on top, in their order; `warnings`: sentences.
    - `classes`: cover by the class that stops the most light, empty where the file does
      not tell.
    - `tops`: None without a window band, or without tropics.
    - `requirements`: what an Earth that could be a satellite's has to meet.
    """

    title: str
    facts: Mapping[str, str]
    warnings: Sequence[str]
    covers: Covers
    classes: Mapping[str, float]
    types: CloudTypes
    bands: Sequence[SplitBand]
    tops: ColdTops | None
    requirements: Sequence[Requirement]

    def numbers(self) -> dict[str, Any]:
        """Return all of it as plain data; None stands for what is not known."""
        return {
            "title": self.title,
            "facts": dict(self.facts),
            "warnings": list(self.warnings),
            "targets": [one.numbers() for one in self.requirements],
            "cover": self.covers.numbers(),
            "cover_by_class": dict(self.classes),
            "isccp": self.types.numbers(),
            "bands": {band.name: band.numbers() for band in self.bands},
            "cold_tops": None if self.tops is None else self.tops.numbers(),
        }


def validate(
    seen: SeenEarth,
    cube: WeatherCube,
    bands: Sequence[int] | None = None,
    *,
    allow_mismatch: bool = False,
) -> Validation:
    """Compare an image with the analysis by which it was rendered.

    **Arguments:** `bands`: those of the image to show, by default all;
    `allow_mismatch`: compare although their times are more than half an hour apart.

    **Raises:** `DataError` for an analysis of another time, or of less than half of
    what the image shows.
    """
    late = check_close(cube, seen.name, seen.time, allow_mismatch)
    counted = seen.counted.copy()
    φ, λ, area = (
        x[counted] for x in (seen.latitude_deg, seen.longitude_deg, seen.area_m2)
    )
    held = held_pixels(cube, seen.name, φ, λ, area)
    counted[counted] = held
    φ, λ, area = φ[held], λ[held], area[held]
    fraction = np.clip(seen.fraction[counted], 0, 1)
    top_hpa = top_pressures_hpa(cube, φ, λ, seen.top_m[counted])
    sky = told_sky(cube, φ, λ)
    covers = compare_covers(
        seen_covers(fraction, top_hpa, φ), sky.seen, sky.independent, φ, λ, area
    )
    part = finest_part(seen.latitude_deg, seen.longitude_deg, seen.area_m2)
    shown = [
        _split(band, seen.fraction, counted, part)
        for number, band in seen.bands.items()
        if bands is None or number in bands
    ]
    tops = _tops(seen, counted, sky.convection, φ, area)
    spectra = {b.name: b.spectrum for b in shown if b.spectrum is not None}
    return Validation(
        title=f"{seen.name} beside {cube.path.name}",
        facts=_facts(seen, cube, sky, counted),
        warnings=[late] if late else [],
        covers=covers,
        classes=_classes(seen, counted, fraction, area),
        types=cloud_types(fraction, seen.optical_depth[counted], top_hpa, area),
        bands=shown,
        tops=tops,
        requirements=requirements_of(covers, tops, spectra),
    )


def _split(band: BandRadiances, fraction, counted, part: FinestPart | None):
    image = band.shown() if band.is_known else np.asarray(band.values, float)
    known = counted & np.isfinite(image)
    spectrum = None
    if part is not None:
        spectrum = row_spectrum(image[part.rows, part.columns], part.pixel_km)
    return SplitBand(
        name=f"C{band.number:02d}",
        words=_words(band),
        clear=image[known & (fraction < CLEAR_BELOW)],
        cloudy=image[known & (fraction > CLOUDY_ABOVE)],
        spectrum=spectrum,
    )


def _classes(seen: SeenEarth, counted, fraction, area_m2) -> dict[str, float]:
    if seen.cloud_class is None:
        return {}
    return class_covers(fraction, seen.cloud_class[counted], seen.class_names, area_m2)


def _words(band: BandRadiances) -> str:
    if not band.is_known or band.band is None:
        return f"{band.quantity.words} ({band.units})"
    return (
        "reflectance factor" if band.band.reflective else "brightness temperature (K)"
    )


def _tops(seen: SeenEarth, counted, convection, latitude_deg, area_m2):
    number = window_band(seen.bands)
    if number is None:
        return None
    kelvin = seen.bands[number].shown()[counted]
    return cold_tops(number, kelvin, convection, latitude_deg, area_m2)


def _facts(seen: SeenEarth, cube: WeatherCube, sky, counted) -> dict[str, str]:
    return {
        "image": seen.name,
        "time of the image": f"{seen.time:%Y-%m-%d %H:%M} UTC",
        "analysis": cube.path.name,
        "time of the analysis": f"{cube.valid_time:%Y-%m-%d %H:%M} UTC",
        "finest pixel": f"{seen.pixel_km:.3g} km",
        "pixels": f"{np.count_nonzero(counted)} that take at most {MOST_STRETCH:g} "
        "times the ground of the finest (70 degrees from the vertical, from "
        "geostationary orbit)",
        "total cover": sky.total_words,
        **{f"{name} cloud": sky.said[name] for name in ("high", "middle", "low")},
        "deep convection": sky.said["deep_convection"],
    }


def _summary(values: Float[np.ndarray, " n"]) -> dict[str, float | int | None]:
    known = values.size > 0
    return {
        "pixels": int(values.size),
        "mean": float(values.mean()) if known else None,
        "std": float(values.std()) if known else None,
    }
