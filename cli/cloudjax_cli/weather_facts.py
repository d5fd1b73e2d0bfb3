"""What renders of a sensor take from a weather file, in words."""

from collections.abc import Iterator
from pathlib import Path

from cloudjax_data import read_weather
from cloudjax_scenes.weather_decision import DECISIONS


def weather_rows(file: Path) -> Iterator[tuple[str, str]]:
    """What a file holds, and what each decision on clouds takes from it.

    **Raises:** `DataError` if it is no weather file that serves.
    """
    cube = read_weather(file)
    levels = cube.data["level"].to_numpy()
    yield "weather", str(file)
    yield "time", f"{cube.valid_time:%Y-%m-%d %H:%M} UTC"
    yield "extent", cube.extent
    yield "levels", f"{len(levels)}, from {levels[0]:g} to {levels[-1]:g} hPa"
    for note in cube.notes:
        yield "mind", note
    if not cube.is_global:
        yield "mind", "regional: renders of a sensor need the whole Earth"
    for name, decision in DECISIONS.items():
        for label, text in decision.words(cube):
            yield f"{name}: {label}", text
