"""Writers of small GRIB files, by eccodes."""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np


def write_grib(
    path: Path,
    fields: Mapping[tuple[str, int], np.ndarray],
    *,
    latitude_deg: Sequence[float] | np.ndarray,
    longitude_deg: Sequence[float] | np.ndarray,
    time: datetime = datetime(2019, 10, 27, 18, tzinfo=UTC),
    edition: int = 2,
    scan: int = 0,
    extra: Mapping[str, Any] | None = None,
) -> Path:
    """Write messages on a regular grid and return the path.

    **Arguments:**

    - `fields`: by GRIB short name and level in hPa (0 for the surface, 2 for the air
        two metres above it, from 2000 on in Pa), `[latitude, longitude]` in the order
        of the axes; NaN is masked by a bitmap.
    - `latitude_deg`: descending, as in GFS files; `longitude_deg`: ascending eastward.
    - `scan`: the order in which the points are written, flags of GRIB: 0x80 columns
        from the east, 0x40 rows from the south, 0x20 column by column, 0x10 every other
        line backwards.
    - `extra`: further keys of eccodes, set last in every message.
    """
    rows, columns = scanned_axes(len(latitude_deg), len(longitude_deg), scan)
    keys = {
        "Ni": len(longitude_deg),
        "Nj": len(latitude_deg),
        "latitudeOfFirstGridPointInDegrees": latitude_deg[rows[0]],
        "latitudeOfLastGridPointInDegrees": latitude_deg[rows[-1]],
        "longitudeOfFirstGridPointInDegrees": longitude_deg[columns[0]],
        "longitudeOfLastGridPointInDegrees": longitude_deg[columns[-1]],
        "scanningMode": scan,
        "iDirectionIncrementInDegrees": (longitude_deg[1] - longitude_deg[0]) % 360,
        "jDirectionIncrementInDegrees": latitude_deg[0] - latitude_deg[1],
        **(extra or {}),
    }
    sample = f"regular_ll_pl_grib{edition}"
    written = {key: in_order(values, scan) for key, values in fields.items()}
    return _write_messages(path, written, sample, keys, time)


def scanned_axes(rows: int, columns: int, scan: int) -> tuple[range, range]:
    """Rows from the north and columns from the west, in the order of a scan."""
    return (
        range(rows)[::-1] if scan & 0x40 else range(rows),
        range(columns)[::-1] if scan & 0x80 else range(columns),
    )


def in_order(values: np.ndarray, scan: int) -> np.ndarray:
    """The points of a field, rows from the north, one by one as they are scanned."""
    count, across = values.shape
    rows, columns = scanned_axes(count, across, scan)
    points, back = [], False
    for outer in columns if scan & 0x20 else rows:
        line = rows if scan & 0x20 else columns
        for inner in reversed(line) if back else line:
            place = (inner, outer) if scan & 0x20 else (outer, inner)
            points.append(values[place])
        back = bool(scan & 0x10) and not back
    return np.array(points)


def write_lambert_grib(
    path: Path,
    fields: Mapping[tuple[str, int], np.ndarray],
    *,
    time: datetime = datetime(2019, 10, 27, 18, tzinfo=UTC),
    wind_relative_to_grid: bool = True,
    standard_latitudes_deg: tuple[float, float] = (25.0, 60.0),
    scan: int = 0x40,
    first_deg: tuple[float, float] = (20.0, 230.0),
    extra: Mapping[str, Any] | None = None,
) -> Path:
    """Write messages on a Lambert map of North America, of fields with rows from the
    south.

    **Arguments:** `scan`, `extra`: as of `write_grib`; `first_deg`: latitude and
    longitude of the point that the scan starts with.
    """
    rows, columns = next(iter(fields.values())).shape
    keys = {
        "gridType": "lambert",
        "shapeOfTheEarth": 6,
        "Nx": columns,
        "Ny": rows,
        "latitudeOfFirstGridPointInDegrees": first_deg[0],
        "longitudeOfFirstGridPointInDegrees": first_deg[1],
        "LaDInDegrees": standard_latitudes_deg[0],
        "LoVInDegrees": 265.0,
        "DxInMetres": 200000,
        "DyInMetres": 200000,
        "Latin1InDegrees": standard_latitudes_deg[0],
        "Latin2InDegrees": standard_latitudes_deg[1],
        "scanningMode": scan,
        "uvRelativeToGrid": int(wind_relative_to_grid),
        **(extra or {}),
    }
    written = {key: in_order(values[::-1], scan) for key, values in fields.items()}
    return _write_messages(path, written, "regular_ll_pl_grib2", keys, time)


def _type_of_level(level: int) -> str:
    near_the_ground = {0: "surface", 2: "heightAboveGround"}
    pressure = "isobaricInhPa" if level < 2000 else "isobaricInPa"
    return near_the_ground.get(level, pressure)


def _write_messages(
    path: Path,
    fields: Mapping[tuple[str, int], np.ndarray],
    sample: str,
    keys: Mapping[str, Any],
    time: datetime,
) -> Path:
    # Not at the top: eccodes loads a PROJ of its own, which crashes a pyproj that is
    # imported after it.
    import eccodes

    with path.open("wb") as stream:
        for (name, level), values in fields.items():
            message = eccodes.codes_grib_new_from_samples(sample)
            settings = {
                **keys,
                "dataDate": int(f"{time:%Y%m%d}"),
                "dataTime": int(f"{time:%H%M}"),
                "typeOfLevel": _type_of_level(level),
                "level": level,
                "shortName": name,
                "bitsPerValue": 24,
                "bitmapPresent": int(np.isnan(values).any()),
                "missingValue": 1e20,
            }
            for key, value in settings.items():
                eccodes.codes_set(message, key, value)
            filled = np.nan_to_num(values.astype(np.float64), nan=1e20)
            eccodes.codes_set_values(message, filled.ravel())
            eccodes.codes_write(message, stream)
            eccodes.codes_release(message)
    return path
