"""Whether renders keep what fronts promise: python -m benchmarks.promise -o DIR

50 scenes of which no front was measured are rendered as `cloudjax render --max-error`
does, and compared with the reference: sensors, pixels of 0.1 to 10 km, day, twilight
and night, much and little cloud, other bands. 45 are over weather, and five of one
folder of imagery by night. An error keeps its promise within a factor of 2 up or down,
and so does a time. Prints a table, and writes it with the numbers after each scene.
"""

import argparse
import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np

from cloudjax import render
from cloudjax_cli.held_memory import forget_if_much
from cloudjax_cli.subjects import folder_subject
from cloudjax_data.whole_files import write_text_whole
from cloudjax_fit.fit_inputs import read_inputs
from cloudjax_fit.fitted_image import fitted_image
from cloudjax_scenes.image_strips import render_strips
from cloudjax_scenes.quality import REFERENCE, Quality
from cloudjax_scenes.trade.fronts import Expected, front_for
from cloudjax_scenes.trade.stopwatch import Stopwatch
from cloudjax_scenes.trade.subjects import sensor_subject, some_of
from cloudjax_scenes.trade.trial import Subject, band_error
from cloudjax_scenes.weather_scene import World, open_world

from .parts import text
from .parts.promise_scenes import IMAGERY_BANDS, cases


# Pixels that are compared with the reference.
_COMPARED = 8192
_FACTOR = 2.0


@dataclass(frozen=True)
class Kept:
    """What was promised of a scene, and what came of it."""

    scene: str
    bands: tuple[int, ...]
    pixels: int
    options: str
    error: float
    error_expected: float
    seconds: float
    seconds_expected: float
    compiled_s: float

    @property
    def keeps_error(self) -> bool:
        return _near(self.error, self.error_expected)

    @property
    def keeps_seconds(self) -> bool:
        return _near(self.seconds, self.seconds_expected)


def _near(found: float, expected: float) -> bool:
    return expected / _FACTOR <= found <= expected * _FACTOR


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--weather", type=Path, required=True, help="GRIB")
    parser.add_argument("--scene", type=Path, action="append", default=[])
    parser.add_argument("-o", "--output", type=Path, required=True)
    asked = parser.parse_args()
    asked.output.mkdir(parents=True, exist_ok=True)
    rows: list[Kept] = []
    for row in _rows(asked.weather, asked.scene):
        rows.append(row)
        forget_if_much()
        print(" | ".join(cells(row)), flush=True)
        numbers = json.dumps([asdict(row) for row in rows], indent=1) + "\n"
        write_text_whole(asked.output / "promise.json", numbers)
        write_text_whole(asked.output / "promise.md", table(rows))
    print(table(rows))


def _rows(weather: Path, folders: Sequence[Path]) -> Iterator[Kept]:
    for folder in folders:
        known = set(read_inputs(folder).target.imagery.bands)
        for bands in (some for some in IMAGERY_BANDS if known.issuperset(some)):
            inputs = read_inputs(folder, bands=bands)
            subject = folder_subject(folder.name, inputs, shadows=0)
            yield kept(subject, 0.03, lambda q, inputs=inputs: fitted_image(inputs, q))
    world = open_world([weather], None)
    assert isinstance(world, World)
    for case in cases():
        time = world.series.times[0] + timedelta(hours=case.hours)
        subject = sensor_subject(world, case.sensor, case.bands, time)

        def whole(quality: Quality, case=case, time=time) -> object:
            bands = case.sensor.choose(case.bands)
            winds: Any = world.winds(time)
            of_quality: Any = quality.of_world(world)
            return list(render_strips(of_quality, case.sensor, bands, time, winds))

        yield kept(subject, case.max_error, whole)


def kept(subject: Subject, max_error: float, whole) -> Kept:
    """Choose, render the whole image, and compare some of it with the reference.

    **Arguments:** `whole`: renders the image with a quality.
    """
    front, _ = front_for(subject.outline.kind)
    expected = _chosen(front, max_error, subject)
    watch = Stopwatch()
    with watch.running():
        whole(expected.quality)
    rays = some_of(subject.rays, _COMPARED)

    def radiances(quality: Quality) -> np.ndarray:
        scene = subject.scene(quality)
        image = render(scene, rays, subject.sun_direction, with_products=True)
        return np.asarray(scene.total(image.radiances), np.float64)

    pairs = zip(radiances(expected.quality), radiances(REFERENCE), strict=True)
    return Kept(
        scene=subject.name,
        bands=subject.outline.bands,
        pixels=subject.outline.pixels,
        options=expected.quality.words,
        error=max(band_error(seen, true).rmse for seen, true in pairs),
        error_expected=expected.error,
        seconds=watch.took_s,
        seconds_expected=expected.seconds,
        compiled_s=watch.compiled_s,
    )


def _chosen(front, max_error: float, subject: Subject) -> Expected:
    """The best there is where that is not as good as asked, as a user would."""
    every = front.expected(subject.outline)
    return front.within_error(max(max_error, every[-1].error), subject.outline)


def cells(row: Kept) -> list[str]:
    """Write one row of the table."""
    bands = ", ".join(map(str, row.bands))
    return [
        row.scene.partition(" over ")[0],
        bands,
        row.options,
        f"{row.error_expected:.2%}",
        f"{row.error:.2%}" + ("" if row.keeps_error else " !"),
        f"{row.seconds_expected:.2g}",
        f"{row.seconds:.2g}" + ("" if row.keeps_seconds else " !"),
    ]


def table(rows: Sequence[Kept]) -> str:
    """Write all rows as Markdown, and how many keep their promises."""
    head = ["scene", "bands", "options"]
    head += ["error expected", "found", "s expected", "taken"]
    errors, seconds = (
        np.mean([getattr(row, name) for row in rows])
        for name in ("keeps_error", "keeps_seconds")
    )
    return (
        text.table(head, [cells(row) for row in rows])
        + f"\n\n{len(rows)} scenes: errors within a factor of {_FACTOR:g} of what was "
        f"expected in {errors:.0%}, times in {seconds:.0%}.\n"
    )


if __name__ == "__main__":
    main()
