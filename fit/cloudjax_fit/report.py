"""Self-contained HTML pages: what a fit did, and how two sets of radiances compare.

Both pages are one template filled with plain data, so that they can be written from a
fit, from files, or from a test. They open offline.
"""

import json
import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias

import numpy as np
from jaxtyping import Num

from cloudjax_data.whole_files import write_text_whole
from cloudjax_fit import figures
from cloudjax_scenes.display import Display
from cloudjax_scenes.html_template import html_template
from cloudjax_scenes.quantity import RADIANCE, Quantity

from .comparison import BandComparison, Comparison, comparison_json
from .cover_and_tops import CloudPair
from .figures import Curve, Stroke
from .fitted_cloud import FittedCloud
from .histogram import Distances, Pixels, Quantiles, sample_of
from .texture import TexturePair


Image: TypeAlias = Num[np.ndarray, "_ _"]
# Spelt out, because beartype does not count an int as a float.
Real: TypeAlias = float | int | np.floating
DASH = "–"
FIRST_THERMAL_BAND = 7


@dataclass(frozen=True, eq=False)
class WeightedPixels:
    """`WeightedPixels` are simulated radiances with the weights of their pixels; None
    for equal weights.
    """

    values: Pixels
    weights: Pixels | None = None


@dataclass(frozen=True, eq=False)
class BandReport:
    """A `BandReport` has what the page of a fit shows of one band.

    - `name`: such as "C13 10.3 µm"; `units`: those of all radiances here.
    - `observed`: radiances of the selected pixels, or their quantile table.
    - `simulated_start`, `simulated_fit`: with the parameters before and after the fit.
    - `observed_image`, `simulated_image`: in the quantity that `display` names, NaN
        where masked; drawn side by side on one scale. Either may be absent.
    - `textures`: of the radiances of the observed and of the simulated image.
    """

    number: int
    name: str
    units: str
    observed: Pixels | Quantiles
    simulated_start: WeightedPixels
    simulated_fit: WeightedPixels
    distances_start: Distances | None
    distances_fit: Distances | None
    display: Display
    observed_image: Image | None = None
    simulated_image: Image | None = None
    textures: TexturePair | None = None


@dataclass(frozen=True)
class ParameterRow:
    """A `ParameterRow` is one fitted parameter. Numbers that are not known are None or
    NaN.

    `determined` says whether the data, rather than the prior or the bounds, set it.
    """

    name: str
    value: Real
    std: Real | None = None
    start: Real | None = None
    unit: str = ""
    prior: str = ""
    lower: Real | None = None
    upper: Real | None = None
    determined: bool = True
    at_bound: bool = False
    note: str = ""


@dataclass(frozen=True, eq=False)
class FitReport:
    """A `FitReport` has all that the page of a fit shows.

    - `scene`: facts in the order in which they are shown.
    - `status`: one sentence; `converged` and `interrupted` decide how it is marked.
    - `clouds`: what each class is made of, by name.
    - `seconds`: wall time by phase, such as `{"compile": 3.1, "solve": 9.0}`.
    - `warnings`, `undetermined`: sentences; the latter name combinations of parameters.
    - `history`: loss after each step.
    """

    title: str
    scene: Mapping[str, str]
    status: str
    converged: bool
    bands: Sequence[BandReport]
    clouds: Mapping[str, FittedCloud] = field(default_factory=dict)
    parameters: Sequence[ParameterRow] = ()
    undetermined: Sequence[str] = ()
    warnings: Sequence[str] = ()
    history: Sequence[Real] = ()
    seconds: Mapping[str, Real] = field(default_factory=dict)
    seeds: Mapping[str, int] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)
    interrupted: bool = False


def write_fit_report(path: str | os.PathLike[str], report: FitReport) -> None:
    """Write the page of a fit to `path`, whole or not at all."""
    page = _Page(
        title=report.title,
        facts=report.scene,
        warnings=report.warnings,
        bands=[_fit_band(band) for band in report.bands],
        versions=report.versions,
        fit=report,
        history=figures.history_figure(report.history) if report.history else None,
    )
    write_text_whole(path, _render(page))


def write_comparison(path: str | os.PathLike[str], comparison: Comparison) -> None:
    """Write the page of a comparison to `path`, and its numbers beside it as JSON.

    The second file has the name of the first with the suffix `.json`.
    """
    page = _Page(
        title=comparison.title,
        facts=dict(zip("AB", comparison.names, strict=True)) | dict(comparison.facts),
        warnings=comparison.warnings,
        bands=[_compared_band(band) for band in comparison.bands],
        clouds=comparison.clouds,
        tops=_tops_figure(comparison.clouds),
        versions=comparison.versions,
    )
    numbers = json.dumps(comparison_json(comparison), indent=2, allow_nan=False)
    write_text_whole(path, _render(page))
    write_text_whole(Path(path).with_suffix(".json"), numbers + "\n")


def format_number(number: Real | None, digits: int = 3) -> str:
    """Return `digits` significant figures, or a dash for what is absent or not finite.

    Figures before the decimal point are never rounded away: 15999 is no 16000.
    """
    if number is None or not math.isfinite(number):
        return DASH
    if number == 0:
        return "0"
    rounded = float(f"{number:.{digits - 1}e}")
    exponent = _exponent(rounded)
    if _is_plain(exponent):
        return _decimals(number, digits - 1 - exponent)
    mantissa = _decimals(rounded / 10.0**exponent, digits - 1)
    return f"{mantissa} × 10{_superscript(exponent)}"


def format_with_std(value: Real | None, std: Real | None) -> str:
    """Return a value and its standard deviation to the same decimal place.

    The value has 3 significant figures: more where the deviation would otherwise
    vanish, fewer where they would go beyond the second figure of the deviation.
    """
    if value is None or not math.isfinite(value):
        return DASH
    if std is None or not math.isfinite(std):
        return f"{format_number(value)} ± {DASH}"
    larger = max(abs(value), abs(std))
    exponent = _exponent(larger) if larger > 0 else 0
    plain = _is_plain(exponent)
    scale = 1.0 if plain else 10.0**exponent
    places = _shared_places(value / scale, std / scale)
    pair = f"{_decimals(value / scale, places)} ± {_decimals(std / scale, places)}"
    return pair if plain else f"({pair}) × 10{_superscript(exponent)}"


@dataclass(frozen=True, eq=False)
class _Column:
    """One sample that is compared with the reference of its band."""

    label: str
    distances: Distances | None


@dataclass(frozen=True, eq=False)
class _BandView:
    number: int
    name: str
    units: str
    columns: Sequence[_Column]
    density: str | None
    difference: str | None
    texture: str | None
    texture_words: str
    images: str | None
    n_images: int
    remarks: Sequence[str]


@dataclass(frozen=True, eq=False)
class _Page:
    title: str
    facts: Mapping[str, str]
    warnings: Sequence[str]
    bands: Sequence[_BandView]
    versions: Mapping[str, str]
    fit: FitReport | None = None
    history: str | None = None
    clouds: CloudPair | None = None
    tops: str | None = None


def _fit_band(band: BandReport) -> _BandView:
    start, fitted = band.simulated_start, band.simulated_fit
    return _band_view(
        band,
        columns=[
            _Column("start", band.distances_start),
            _Column("fit", band.distances_fit),
        ],
        curves=[
            ("observed", _curve("observed", figures.REFERENCE, band.observed)),
            ("start", _curve("start", figures.BEFORE, start.values, start.weights)),
            ("fit", _curve("fit", figures.AFTER, fitted.values, fitted.weights)),
        ],
        images=[("observed", band.observed_image), ("fit", band.simulated_image)],
        display=band.display,
        textures=band.textures,
    )


def _compared_band(band: BandComparison) -> _BandView:
    quantity = band.a.quantity
    display = Display(
        f"{quantity.words} ({_pretty(band.units)})", band.number >= FIRST_THERMAL_BAND
    )
    images = [(label, each.image()) for label, each in [("A", band.a), ("B", band.b)]]
    return _band_view(
        band,
        columns=[_Column("B against A", band.distances)],
        curves=[
            ("A", _curve("A", figures.REFERENCE, band.a.pixels())),
            ("B", _curve("B", figures.AFTER, band.b.pixels())),
        ],
        images=images,
        display=display,
        textures=band.textures,
        quantity=quantity,
    )


def _band_view(
    band: BandReport | BandComparison,
    columns: Sequence[_Column],
    curves: Sequence[tuple[str, Curve | None]],
    images: Sequence[tuple[str, Image | None]],
    display: Display,
    textures: TexturePair | None,
    quantity: Quantity = RADIANCE,
) -> _BandView:
    units = _pretty(band.units)
    axis = f"{quantity.words} ({units})"
    labels = images[0][0], images[-1][0]
    drawn = [curve for _, curve in curves if curve is not None]
    has_reference = curves[0][1] is not None
    shown = [(title, image) for title, image in images if image is not None]
    return _BandView(
        number=band.number,
        name=band.name,
        units=units,
        columns=columns,
        density=figures.density_figure(drawn, axis) if drawn else None,
        difference=figures.difference_figure(drawn, axis) if has_reference else None,
        texture=_texture_figure(textures, labels, units),
        texture_words=_texture_words(textures, labels),
        images=figures.images_figure(shown, display) if shown else None,
        n_images=len(shown),
        remarks=[
            f"The pixels of “{label}” hold no finite pixel and are not drawn."
            for label, curve in curves
            if curve is None
        ],
    )


def _tops_figure(clouds: CloudPair | None) -> str | None:
    if clouds is None:
        return None
    strokes = figures.REFERENCE, figures.AFTER
    curves = [
        _curve(label, stroke, seen.tops_k)
        for (label, seen), stroke in zip(clouds.sides, strokes, strict=True)
        if seen.tops_k is not None
    ]
    drawn = [curve for curve in curves if curve is not None]
    axis = f"brightness temperature of cloud in {clouds.window} (K)"
    return figures.density_figure(drawn, axis) if drawn else None


def _texture_figure(
    pair: TexturePair | None, labels: tuple[str, str], units: str
) -> str | None:
    if pair is None:
        return None
    named = list(zip(labels, (pair.reference, pair.other), strict=True))
    return figures.texture_figure(named, units)


def _texture_words(pair: TexturePair | None, labels: tuple[str, str]) -> str:
    """How far the second image is from the first, at the worst of all scales."""
    if pair is None:
        return ""
    power, ratio = pair.power_ratio_db, pair.increment_ratio
    if np.isnan(power).all() or np.isnan(ratio).all():
        return ""
    worst = int(np.nanargmax(np.abs(power)))
    return (
        f"Power of “{labels[1]}” is within {format_number(abs(power[worst]), 2)} dB of "
        f"that of “{labels[0]}” in every octave, worst from "
        f"{pair.reference.wavelength[worst]:g} pixels on; its differences are "
        f"{format_number(np.nanmin(ratio))} to {format_number(np.nanmax(ratio))} times "
        "as large."
    )


def _curve(
    label: str,
    stroke: Stroke,
    values: Pixels | Quantiles,
    weights: Pixels | None = None,
) -> Curve | None:
    """A curve of the usable pixels: a fit that went wrong still gets its report."""
    if isinstance(values, Quantiles):
        return Curve(label, sample_of(values), stroke)
    values = np.asarray(values, float)
    weights = np.ones_like(values) if weights is None else np.asarray(weights, float)
    usable = np.isfinite(values) & np.isfinite(weights) & (weights > 0)
    if not usable.any():
        return None
    return Curve(label, sample_of(values[usable], weights[usable]), stroke)


def _render(page: _Page) -> str:
    filters = {"number": format_number, "with_std": format_with_std}
    template = html_template("cloudjax_fit", "report.html.jinja", filters)
    return template.render(page=page, fit=page.fit, dash=DASH)


def _exponent(number: Real) -> int:
    return math.floor(math.log10(abs(number)))


def _is_plain(exponent: int) -> bool:
    return -4 < exponent < 6


def _shared_places(value: Real, std: Real) -> int:
    places = 2 - _exponent(value) if value else 0
    if std > 0:
        first = -_exponent(std)
        places = max(first, min(places, first + 1))
    return min(max(places, 0), 9)


def _decimals(number: Real, places: int) -> str:
    # "−" is as wide as "+" and the digits, and does not break from them.
    text = f"{number:.{max(places, 0)}f}".replace("-", "−")
    return text.removeprefix("−") if float(text.replace("−", "-")) == 0 else text


def _superscript(exponent: int | str) -> str:
    return str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def _pretty(units: str) -> str:
    """Units of a netCDF file, such as "W m-2 sr-1 um-1", as they are printed."""
    raised = re.sub(r"(?<=[A-Za-z)])-\d", lambda power: _superscript(power[0]), units)
    return re.sub(r"\bum(?![A-Za-z])", "µm", raised)
