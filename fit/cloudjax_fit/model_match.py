"""Whether a weather model and an image are of one time and place, and what if not."""

from dataclasses import dataclass
from datetime import datetime

from cloudjax_data import DataError, WrfColumns, WrfFrame, WrfRun, read_wrf
from cloudjax_scenes.model_overlap import Overlap, overlap_of, places_of
from cloudjax_scenes.scene_places import scene_places, where

from .time_apart import SLACK, in_words
from .vantage import Vantage


# Either of the columns or of the image: a nest is a small part of a disc.
LEAST_SHARE = 0.5
_SAID = "%Y-%m-%d %H:%M UTC"


@dataclass(frozen=True, eq=False)
class Match:
    """A `Match` is one time of a model beside an image.

    **Fields:**

    - `overlap`: the part of the image that lies over the columns.
    - `mismatches`: clauses on what does not match.
    """

    columns: WrfColumns
    vantage: Vantage
    overlap: Overlap
    mismatches: tuple[str, ...]


def match_model(
    run: WrfRun,
    vantage: Vantage,
    *,
    time: datetime | None = None,
    place: tuple[float, float] | None = None,
    allow_mismatch: bool = False,
) -> Match:
    """Find what of a model an image shows.

    **Arguments:**

    - `time`: of the model; by default the nearest to the image's.
    - `place`: centre of an ideal run, latitude and longitude.
    - `allow_mismatch`: go on where times are more than `SLACK` apart, or less than
        `LEAST_SHARE` of the columns and of the image overlap.

    **Raises:** `DataError` where times or places do not match and that is not allowed;
    where nothing overlaps, in any case.
    """
    frame = run.nearest(vantage.time) if time is None else run.at(time)
    columns = read_wrf(frame, place)
    times = _times(frame, vantage)
    overlap = overlap_of(vantage.grid, columns)
    if overlap is None:
        also = f", and {times}" if times else ""
        raise DataError(
            f"{frame.path} is nowhere in {vantage.name}: {_places(columns, vantage)}"
            f"{also}; give a model and an image of one place and time."
        )
    mismatches = tuple(filter(None, (times, _shares(overlap, columns, vantage))))
    if mismatches and not allow_mismatch:
        raise DataError(
            f"{frame.path} does not match {vantage.name}: {'; '.join(mismatches)}; "
            "give a model and an image of one place and time, or compare these all the "
            "same with --allow-mismatch."
        )
    return Match(columns, vantage, overlap, mismatches)


def _times(frame: WrfFrame, vantage: Vantage) -> str:
    apart = abs(frame.time - vantage.time)
    if apart <= SLACK:
        return ""
    return (
        f"the model is of {frame.time.strftime(_SAID)} and the image of "
        f"{vantage.time.strftime(_SAID)}, {in_words(apart)} apart"
    )


def _shares(overlap: Overlap, columns: WrfColumns, vantage: Vantage) -> str:
    if max(overlap.of_image, overlap.of_columns) >= LEAST_SHARE:
        return ""
    return (
        f"{_places(columns, vantage)}, so that {overlap.of_columns:.1%} of the columns "
        f"are in the image and {overlap.of_image:.1%} of the image is over columns"
    )


def _places(columns: WrfColumns, vantage: Vantage) -> str:
    model, image = where(*places_of(columns.grid)), scene_places(vantage.grid)
    seen = where(*image) if image[0].size else "no place on the Earth"
    return f"the model is at {model}, and the image at {seen}"
