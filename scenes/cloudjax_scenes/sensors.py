"""Sensors by name, such as `abi-fulldisk-10km`, or from a TOML file.

kind = "camera"
latitude_deg = 25.0
...
"""

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cloudjax import Camera, FixedGrid
from cloudjax.geometry.fixed_grid import FULL_DISC_PIXELS, GOES_EAST_DEG
from cloudjax.light.bands import Band, nominal_bands
from cloudjax.toml_table import LIST, NUMBER, TEXT, WHOLE, TomlError, checked, read_toml
from cloudjax_data import DataError

from .data_errors import data_errors
from .sensor_bands import bands_from


SECTORS = ("fulldisk", "conus", "meso")
RESOLUTIONS_KM = tuple(FULL_DISC_PIXELS)
SENSOR_NAMES = tuple(
    f"abi-{sector}-{km:g}km" for sector in SECTORS for km in RESOLUTIONS_KM
)

_NAME = re.compile(r"abi-([a-z]+)-([0-9.]+)km")
_COMMON = {"name": TEXT, "platform": TEXT, "bands": LIST}
_ABI = {"sector": TEXT, "resolution_km": NUMBER}
_ABI_OPTIONAL = dict.fromkeys(
    ("subsatellite_longitude_deg", "latitude_deg", "longitude_deg"), NUMBER
)
_CAMERA = {
    "latitude_deg": NUMBER,
    "longitude_deg": NUMBER,
    "altitude_m": NUMBER,
    "field_of_view_deg": NUMBER,
    "rows": WHOLE,
    "columns": WHOLE,
}
_ATTITUDE = dict.fromkeys(("azimuth_deg", "elevation_deg"), NUMBER)
_TARGET = dict.fromkeys(("target_latitude_deg", "target_longitude_deg"), NUMBER)
_CAMERA_OPTIONAL = {"roll_deg": NUMBER}
_TARGET_OPTIONAL = {"roll_deg": NUMBER, "target_altitude_m": NUMBER}


@dataclass(frozen=True, eq=False)
class Sensor:
    """A `Sensor` needs no file of radiances.

    **Fields:**

    - `name`, `platform`: for titles and attributes.
    - `view`: where its pixels look; `view.rays()` gives their lines of sight.
    - `bands`: by number.
    """

    name: str
    platform: str
    view: FixedGrid | Camera
    bands: Mapping[int, Band]

    def choose(self, numbers: Sequence[int] | None) -> list[Band]:
        """Return its bands of these numbers, or all.

        **Raises:** `DataError` for one that it lacks.
        """
        missing = sorted(set(numbers or ()) - set(self.bands))
        if missing:
            raise DataError(
                f"{self.name} has no band {', '.join(map(str, missing))}: it has "
                f"{', '.join(map(str, self.bands))}."
            )
        return [self.bands[n] for n in numbers or self.bands]


@data_errors()
def read_sensor(
    name_or_path: str | os.PathLike[str],
    *,
    subsatellite_longitude_deg: float | None = None,
    centre: tuple[float, float] | None = None,
) -> Sensor:
    """Return a sensor by name, or from a TOML file (`docs/formats.md`, section
    Sensors).

    **Arguments:**

    - `name_or_path`: one of `SENSOR_NAMES`, or a file.
    - `subsatellite_longitude_deg`: of an ABI, in place of 75 W or the file's.
    - `centre`: latitude and longitude of a mesoscale sector.

    **Raises:** `DataError` for a name that is none, a file that is absent or wrong, or
    options that the sensor cannot use.
    """
    source = str(name_or_path)
    if source in SENSOR_NAMES:
        table, is_name = _named(source), True
    elif _NAME.fullmatch(Path(source).name) and not Path(source).exists():
        raise DataError(
            f"{source} is not a sensor: the names are abi-{{{','.join(SECTORS)}}}-"
            f"{{{','.join(f'{km:g}' for km in RESOLUTIONS_KM)}}}km."
        )
    else:
        what = f"a sensor's TOML or a name such as {SENSOR_NAMES[4]}"
        table, is_name = read_toml(source, what), False
    asked = {"subsatellite_longitude_deg": subsatellite_longitude_deg}
    if centre is not None:
        asked |= {"latitude_deg": centre[0], "longitude_deg": centre[1]}
    asked = {key: value for key, value in asked.items() if value is not None}
    if asked and table.get("kind") == "camera":
        raise DataError(
            f"{source} is a camera: a sub-satellite longitude or a centre is for ABI."
        )
    sensor = _sensor({**table, **asked}, source)
    return sensor if is_name or "name" in table else _renamed(sensor, Path(source).stem)


def _named(name: str) -> dict[str, Any]:
    _, sector, resolution = name.split("-")
    km = float(resolution.removesuffix("km"))
    return {"kind": "abi", "name": name, "sector": sector, "resolution_km": km}


def _renamed(sensor: Sensor, name: str) -> Sensor:
    return Sensor(name, sensor.platform, sensor.view, sensor.bands)


def _sensor(table: Mapping[str, Any], source: str) -> Sensor:
    kind = table.get("kind")
    if kind not in ("abi", "camera"):
        raise DataError(
            f'{source} has the kind {kind!r}: write kind = "abi" or kind = "camera".'
        )
    rest = {key: value for key, value in table.items() if key != "kind"}
    make = _abi_view if kind == "abi" else _camera_view
    try:
        view = make(rest, source)
    except TomlError:
        raise
    except ValueError as error:
        raise DataError(f"{source}: {error}") from error
    bands = bands_from(table["bands"], source) if "bands" in table else nominal_bands()
    platform = table.get("platform", "ABI" if kind == "abi" else "camera")
    return Sensor(table.get("name", ""), platform, view, bands)


def _abi_view(table: Mapping[str, Any], source: str) -> FixedGrid:
    known = checked(table, _ABI, _ABI_OPTIONAL | _COMMON, source)
    sector, km = known["sector"], known["resolution_km"]
    longitude = known.get("subsatellite_longitude_deg", GOES_EAST_DEG)
    if abs(longitude) > 360:
        raise ValueError("subsatellite_longitude_deg must lie within ±360.")
    centre = [known[key] for key in ("latitude_deg", "longitude_deg") if key in known]
    if sector == "meso":
        if len(centre) != 2:
            raise DataError(
                f"{source} is a mesoscale sector without a place: give the latitude "
                "and longitude of its centre."
            )
        return FixedGrid.abi_meso(km, centre[0], centre[1], longitude)
    if sector not in SECTORS:
        raise DataError(
            f"{source} gives sector = {sector!r}: make it one of {', '.join(SECTORS)}."
        )
    if centre:
        raise DataError(
            f"{source} gives a centre, which only a mesoscale sector has: leave it out."
        )
    make = FixedGrid.abi_conus if sector == "conus" else FixedGrid.abi_full_disc
    return make(km, longitude)


def _camera_view(table: Mapping[str, Any], source: str) -> Camera:
    at_target = any(key.startswith("target_") for key in table)
    required = _CAMERA | (_TARGET if at_target else _ATTITUDE)
    optional = _TARGET_OPTIONAL if at_target else _CAMERA_OPTIONAL
    known = checked(table, required, optional | _COMMON, source)
    values = {key: value for key, value in known.items() if key not in _COMMON}
    if not at_target:
        return Camera(**values)
    place = [values.pop(k) for k in ("latitude_deg", "longitude_deg", "altitude_m")]
    return Camera.looking_at(*place, **values)
