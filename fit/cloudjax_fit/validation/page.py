"""The page of a validation, and its numbers beside it."""

import json
import os
from dataclasses import dataclass
from pathlib import Path

from cloudjax_data.whole_files import write_text_whole
from cloudjax_scenes.html_template import html_template

from . import pictures
from .cold_tops import COLD_K, CONVECTS, TROPICS_DEG
from .cover import KINDS
from .isccp import CLIMATOLOGY_WORDS
from .validation import CLEAR_BELOW, CLOUDY_ABOVE, SplitBand, Validation


@dataclass(frozen=True, eq=False)
class _BandView:
    band: SplitBand
    histogram: str | None
    spectrum: str | None


def write_validation(path: str | os.PathLike[str], validation: Validation) -> None:
    """Write the page to `path`, which opens offline, and its numbers beside it.

    The second file has the name of the first with the suffix `.json`.
    """
    template = html_template("cloudjax_fit.validation", "page.html.jinja", _FILTERS)
    page = template.render(
        v=validation,
        kinds=KINDS,
        latitudes=pictures.latitude_figure(validation.covers),
        types=pictures.types_figure(validation.types),
        bands=[_view(band) for band in validation.bands],
        climatology=CLIMATOLOGY_WORDS,
        clear_below=CLEAR_BELOW,
        cloudy_above=CLOUDY_ABOVE,
        cold_k=COLD_K,
        tropics_deg=TROPICS_DEG,
        convects=CONVECTS,
    )
    numbers = json.dumps(validation.numbers(), indent=2, allow_nan=False)
    write_text_whole(path, page)
    write_text_whole(Path(path).with_suffix(".json"), numbers + "\n")


def _view(band: SplitBand) -> _BandView:
    spectrum = None
    if band.spectrum is not None:
        spectrum = pictures.spectrum_figure(band.spectrum, band.words)
    return _BandView(band, pictures.split_figure(band), spectrum)


def _known(text: str) -> str:
    return "–" if "nan" in text else text.replace("-", "−")


_FILTERS = {
    "percent": lambda share: _known(f"{100 * share:.1f}"),
    "points": lambda points: _known(f"{points:+.1f}"),
    "decimals": lambda value, places: _known(f"{value:.{places}f}"),
    "latitude": lambda degrees: (
        f"{abs(degrees):g}°{'N' if degrees > 0 else 'S' if degrees < 0 else ''}"
    ),
}
