"""The index beside a GFS file says which bytes hold which message.

An index has a line for each message, such as
`461:334588216:d=2025080100:HGT:850 mb:anl:`: number, first byte, start of the cycle,
parameter, level, forecast. A message ends where the next one begins, and the last one
at the end of the file (docs/guides/fetch.md).
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime

from .weather_fields import GROUND, OPTIONAL, REQUIRED
from .weather_sky import SKY


_PRESSURE_LEVEL = "isobaricInhPa"
# As NOAA abbreviates the reader's variables; cloud water changed its name.
_ON_LEVELS = {
    "u": ("UGRD",),
    "v": ("VGRD",),
    "w": ("VVEL",),
    "r": ("RH",),
    "t": ("TMP",),
    "gh": ("HGT",),
    "clwmr": ("CLMR", "CLWMR"),
    "icmr": ("ICMR",),
    "tcc": ("TCDC",),
}
# Parameter and level of the reader's fields at the ground, and eccodes' level.
_AT_THE_GROUND = {
    "orog": ("HGT", "surface", 0.0),
    "lsm": ("LAND", "surface", 0.0),
    "t_surface": ("TMP", "surface", 0.0),
    "t_2m": ("TMP", "2 m above ground", 2.0),
}
# 18.4 km in the standard atmosphere: above all cloud, and above the profiles of a fit.
LOWEST_PRESSURE_HPA = 70.0

SELECTION = (
    f"{' '.join((*REQUIRED, *OPTIONAL))} to {LOWEST_PRESSURE_HPA:g} hPa; "
    f"{' '.join((*GROUND, *SKY))}"
)

_LINE = re.compile(
    r"[0-9]+(?:\.[0-9]+)?:(?P<start>[0-9]{1,15}):d=(?P<cycle>[0-9]{10})"
    r":(?P<parameter>[^:]+):(?P<level>[^:]+):(?P<forecast>[^:]*)(?::.*)?"
)
_PRESSURE = re.compile(r"([0-9]{1,4}(?:\.[0-9]+)?) mb")


@dataclass(frozen=True)
class Message:
    """A `Message` is a GRIB message of a file.

    **Fields:** `level_type`, `name` and `level` as eccodes has them (hPa on pressure
    levels); `start` and `end`, the first byte and the one after the last.
    """

    level_type: str
    name: str
    level: float
    start: int
    end: int


def needed_messages(
    index: str, file_size: int, cycle: datetime, lead_hours: int
) -> tuple[Message, ...]:
    """Return the messages that the reader uses, in the order of the file.

    **Arguments:**

    - `index`: the text of the `.idx` file.
    - `file_size`: of the GRIB file, in bytes.
    - `cycle`, `lead_hours`: what the index must be of.

    **Raises:** `ValueError`, saying what is wrong with the index: not one, of another
    cycle or file, or without a variable that `read_weather` requires.
    """
    lines = [_parsed(line) for line in index.splitlines() if line.strip()]
    starts = sorted({int(line["start"]) for line in lines})
    if not starts or starts[-1] >= file_size:
        raise ValueError(f"does not fit the file of {file_size} bytes")
    if any(line["cycle"] != f"{cycle:%Y%m%d%H}" for line in lines):
        raise ValueError(f"is not all of the cycle of {cycle:%Y-%m-%d %H} UTC")
    ends = dict(zip(starts, [*starts[1:], file_size], strict=True))
    forecast = f"{lead_hours} hour fcst" if lead_hours else "anl"
    found = {}
    for line in lines:
        wanted = _wanted(line["parameter"], line["level"])
        if wanted is not None and line["forecast"] == forecast:
            start = int(line["start"])
            found.setdefault(wanted, Message(*wanted, start, ends[start]))
    on_levels = {name for kind, name, _ in found if kind == _PRESSURE_LEVEL}
    missing = [name for name in REQUIRED if name not in on_levels]
    if missing:
        raise ValueError(f"has no {', '.join(missing)} on pressure levels")
    return tuple(sorted(found.values(), key=lambda message: message.start))


def joined_ranges(messages: Iterable[Message]) -> tuple[tuple[int, int], ...]:
    """Return the byte ranges that hold the messages, neighbours in one.

    Fields that share a message, as winds do in older files, are counted once.
    """
    ranges: list[tuple[int, int]] = []
    for start, end in sorted({(m.start, m.end) for m in messages}):
        if ranges and ranges[-1][1] == start:
            ranges[-1] = ranges[-1][0], end
        else:
            ranges.append((start, end))
    return tuple(ranges)


def _parsed(line: str) -> re.Match[str]:
    match = _LINE.fullmatch(line.strip())
    if match is None:
        raise ValueError(f"has a line that is none of an index, {line[:60]!r}")
    return match


def _wanted(parameter: str, level: str) -> tuple[str, str, float] | None:
    """Type, name and level of a message that the reader uses, None for others."""
    for field, (kind, name) in GROUND.items():
        *line, height = _AT_THE_GROUND[field]
        if line == [parameter, level]:
            return kind, name, height
    for field in SKY.values():
        if field.index == (parameter, level):
            return *field.kinds[0], 0.0
    pressure = _PRESSURE.fullmatch(level)
    if pressure is None or float(pressure[1]) < LOWEST_PRESSURE_HPA:
        return None
    for name in (*REQUIRED, *OPTIONAL):
        if parameter in _ON_LEVELS[name]:
            return _PRESSURE_LEVEL, name, float(pressure[1])
    return None
