"""What accuracy costs in scenes of many kinds: python -m benchmarks.fronts -o DIR

Renders scenes at the same qualities, as `cloudjax tradeoff` does one, and writes the
fronts that ship: sensors over an analysis (`--weather`), and a folder of imagery
(`--scene`). After each scene all is written that has been measured, and scenes that DIR
has are not measured again. Prints the tables of docs/accuracy/speed.md.
"""

import argparse
import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from cloudjax import Camera
from cloudjax.light.bands import nominal_bands
from cloudjax_cli.held_memory import forget_if_much
from cloudjax_cli.subjects import folder_subject
from cloudjax_data.whole_files import write_text_whole
from cloudjax_fit.fit_inputs import read_inputs
from cloudjax_scenes.quality import REFERENCE, STANDARD, Quality
from cloudjax_scenes.sensors import Sensor, read_sensor
from cloudjax_scenes.trade.fronts import Front, read_front
from cloudjax_scenes.trade.machine import Machine
from cloudjax_scenes.trade.measured import Measured
from cloudjax_scenes.trade.subjects import sensor_subject
from cloudjax_scenes.trade.trial import Subject, rendered
from cloudjax_scenes.weather_scene import World, open_world

from .parts import text


# Steps and nodes.
QUALITIES = (
    STANDARD,
    *(Quality(*q) for q in ((6, 1), (6, 3), (12, 3), (12, 5), (48, 9))),
)
# One of each part of the spectrum in which cloud, air and ground are alike.
WEATHER_BANDS = 2, 5, 7, 8, 13
IMAGERY_BANDS = 1, 3, 5, 7, 13


def low_orbit(
    latitude_deg: float,
    longitude_deg: float,
    *,
    altitude_m: float = 800e3,
    field_of_view_deg: float = 35.0,
    pixels: int = 512,
) -> Sensor:
    """Make a camera in low orbit that looks two degrees to the north-east."""
    camera = Camera.looking_at(
        latitude_deg,
        longitude_deg,
        altitude_m,
        target_latitude_deg=latitude_deg + 2,
        target_longitude_deg=longitude_deg + 2,
        field_of_view_deg=field_of_view_deg,
        rows=pixels,
        columns=pixels,
    )
    name = f"camera at {latitude_deg:g} {longitude_deg:g}, {altitude_m / 1e3:g} km"
    return Sensor(name, "camera", camera, nominal_bands())


def geostationary(
    name: str, longitude_deg: float, centre: tuple[float, float] | None = None
) -> Sensor:
    """Make an ABI of a name, above a longitude; a sector has a centre."""
    sensor = read_sensor(name, subsatellite_longitude_deg=longitude_deg, centre=centre)
    at = "" if centre is None else f" at {centre[0]:g} {centre[1]:g}"
    return replace(sensor, name=f"{name} above {longitude_deg:g}{at}")


# By day at noon UTC, at which the analysis of the tests is.
SENSORS = (
    geostationary("abi-meso-1km", 0.0, (-5.0, 10.0)),
    geostationary("abi-meso-1km", -30.0, (35.0, -35.0)),
    geostationary("abi-conus-4km", -30.0),
    geostationary("abi-fulldisk-10km", 0.0),
    geostationary("abi-conus-4km", 20.0),
    low_orbit(10.0, -40.0),
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--weather", type=Path, required=True, help="GRIB")
    parser.add_argument("--scene", type=Path, help="folder of ABI files")
    parser.add_argument("-o", "--output", type=Path, required=True)
    asked = parser.parse_args()
    folder = asked.output
    folder.mkdir(parents=True, exist_ok=True)
    known = [read_front(file) for file in folder.glob("*.json")]
    for front in measured_fronts(_subjects(asked.weather, asked.scene), known):
        file = folder / f"{front.kind}.json".replace(" ", "_").replace(",", "")
        write_text_whole(file, json.dumps(front.json(), indent=1) + "\n")
        print(table(front), flush=True)


def _subjects(weather: Path, scene: Path | None) -> Iterator[Subject]:
    if scene is not None:
        inputs = read_inputs(scene, bands=IMAGERY_BANDS)
        yield folder_subject(scene.name, inputs, shadows=0)
    world = open_world([weather], None)
    assert isinstance(world, World)
    for sensor in SENSORS:
        yield sensor_subject(world, sensor, WEATHER_BANDS, world.series.times[0])


def measured_fronts(
    subjects: Iterator[Subject], known: Sequence[Front] = ()
) -> Iterator[Front]:
    """Yield, for each subject, the front of its kind with all measured so far.

    **Arguments:** `known`: fronts whose scenes are not measured again.
    """
    fronts = {front.kind: front for front in known}
    for subject in subjects:
        kind = subject.outline.kind
        front = fronts.get(kind) or Front(kind, Machine.here(), ())
        if subject.name not in {scene.name for scene in front.scenes}:
            front = replace(front, scenes=(*front.scenes, measured(subject)))
        fronts[kind] = front
        yield front


def measured(subject: Subject, qualities: Sequence[Quality] = QUALITIES) -> Measured:
    """Render a subject at all qualities and compare them with the reference."""
    truth = rendered(subject, REFERENCE, repeats=1)
    trials = []
    for quality in qualities:
        trials.append(rendered(subject, quality).against(truth))
        forget_if_much()
        print(f"{subject.name}, {quality.words}: {trials[-1].error:.2%}", flush=True)
    sample = len(subject.rays)
    return Measured(
        subject.name, subject.outline, sample, truth.against(truth), tuple(trials)
    )


def table(front: Front) -> str:
    """Write as Markdown what was measured: of all scenes the middle, least and most."""
    bands = front.scenes[0].outline.bands
    head = ["options", "µs a pixel", "fixed s", *(f"C{n:02d} %" for n in bands)]
    rows = []
    for trials in zip(*(scene.trials for scene in front.scenes), strict=True):
        pixels = [scene.outline.pixels for scene in front.scenes]
        each = [
            (t.seconds - t.fixed_s) / n for t, n in zip(trials, pixels, strict=True)
        ]
        rows.append(
            [
                trials[0].quality.words,
                _ranged([1e6 * s for s in each]),
                _ranged([t.fixed_s for t in trials]),
                *(_ranged([100 * t.errors[n].rmse for t in trials]) for n in bands),
            ]
        )
    names = ", ".join(scene.name for scene in front.scenes)
    return f"{front.kind}: {names}\n\n{text.table(head, rows)}\n"


def _ranged(values: Sequence[float]) -> str:
    middle = f"{np.median(values):.2g}"
    if len(values) == 1:
        return middle
    return f"{middle} ({min(values):.2g}-{max(values):.2g})"


if __name__ == "__main__":
    main()
