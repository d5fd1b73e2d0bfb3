"""Files that say which clouds stand where, by type.

They follow the six steps in which a sky is made: the origin; where clouds stand; their
type; how many; how large; of which shape and of what.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from cloudjax.toml_table import (
    LIST,
    NUMBER,
    POSITIVE,
    TABLE,
    TEXT,
    Kind,
    TomlError,
    checked,
    least,
    read_toml,
    require_known,
)
from cloudjax_data import DataError
from cloudjax_scenes.data_errors import data_errors

from .cloud_types import TYPE_KEYS, CloudType, built_in_types, cloud_type


_TIME = Kind(
    "a time such as 2026-06-21T18:00:00Z", lambda value: isinstance(value, datetime)
)
_FILE = {"clouds": LIST}
_OF_FILE = {"origin": TABLE, "types": TABLE, "time": _TIME, "seed": least(0)}
_ORIGIN = {"latitude_deg": NUMBER, "longitude_deg": NUMBER}
_OF_ORIGIN = {"ground_m": NUMBER}
_GROUP = {"type": TEXT, "quantity": least(1), "within_m": POSITIVE}
_OF_GROUP = {"east_m": NUMBER, "north_m": NUMBER, "along_deg": NUMBER}


@dataclass(frozen=True)
class CloudGroup:
    """A `CloudGroup` is some clouds of a type, in a square.

    **Fields:**

    - `type`: of all.
    - `quantity`: of clouds.
    - `within_m`: the edge of the square in which their middles are.
    - `east_m`, `north_m`: of its middle, from the origin.
    - `along_deg`: where to long clouds are longer, clockwise from north.
    """

    type: CloudType
    quantity: int
    within_m: float
    east_m: float = 0.0
    north_m: float = 0.0
    along_deg: float = 90.0


@dataclass(frozen=True)
class TypedSky:
    """A `TypedSky` is all that a file says.

    **Fields:**

    - `path`: of the file.
    - `origin_deg`: latitude and longitude; None where the file has none.
    - `ground_m`: above the sea, which heights are above.
    - `groups`: of clouds.
    - `time`: of the sun, in UTC; None where the file has none.
    - `seed`: of all that is drawn.
    """

    path: Path
    origin_deg: tuple[float, float] | None
    ground_m: float
    groups: Sequence[CloudGroup]
    time: datetime | None
    seed: int


@data_errors()
def read_sky(path: str | os.PathLike[str]) -> TypedSky:
    """Read a file of clouds by type (`docs/formats.md`, section Clouds by type).

    **Raises:** `DataError` that names the file and the key where the file is absent or
    a key is unknown, missing, of the wrong type or out of range.
    """
    path = Path(path)
    content = read_toml(path, "a TOML file of clouds by type")
    given = checked(content, _FILE, _OF_FILE, str(path))
    if not given["clouds"]:
        raise TomlError(f"{path} has no clouds: add [[clouds]].")
    own = given.get("types", {})
    for name, table in own.items():
        cloud_type(table, f"{path}: type {name}")
    known = {**built_in_types(), **own}
    groups = tuple(
        _group(table, known, f"{path}: clouds {i}")
        for i, table in enumerate(given["clouds"], start=1)
    )
    origin = given.get("origin")
    place, ground = (None, 0.0) if origin is None else _origin(origin, str(path))
    time = given.get("time")
    if time is not None:
        time = time.replace(tzinfo=time.tzinfo or UTC).astimezone(UTC)
    return TypedSky(path, place, ground, groups, time, given.get("seed", 0))


def _origin(table: Any, source: str) -> tuple[tuple[float, float], float]:
    where = f"{source}: origin"
    given = checked(table, _ORIGIN, _OF_ORIGIN, where)
    place = given["latitude_deg"], given["longitude_deg"]
    if not (abs(place[0]) <= 90 and abs(place[1]) <= 360):
        raise DataError(
            f"{where} {place[0]:g},{place[1]:g} is no place: give a latitude within 90 "
            "and a longitude within 360 degrees."
        )
    return place, given.get("ground_m", 0.0)


def _group(table: Any, known: Mapping[str, Any], where: str) -> CloudGroup:
    """A group, whose own numbers go before those of its type."""
    given = checked(table, _GROUP, {**_OF_GROUP, **TYPE_KEYS}, where)
    name = given.pop("type")
    require_known([name], known, "type", where)
    own = {key: given.pop(key) for key in list(given) if key in TYPE_KEYS}
    made = cloud_type({**known[name], **own}, f"{where}, type {name}")
    return CloudGroup(type=made, **given)
