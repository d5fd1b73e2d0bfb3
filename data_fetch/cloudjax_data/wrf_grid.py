"""The columns of a WRF file stand on the map that its attributes name.

Files are cropped and thinned, and then the attributes of place and size are those of
another domain. So the map alone is taken from the attributes, and where the columns
stand on it from their latitudes and longitudes, which must fit.
"""

from collections.abc import Callable
from pathlib import Path

import netCDF4
import numpy as np
from jaxtyping import Float

from cloudjax.geometry.column_grid import ColumnGrid
from cloudjax.geometry.map_projections import (
    MODEL_RADIUS_M,
    AbstractMapProjection,
    ConformalConic,
    LatLonMap,
    LocalPlane,
    Mercator,
)

from .errors import DataError


# Of the distance of columns. Single precision moves places by some metres.
_TOLERANCE = 0.05
_LATLON = 6
Places = Float[np.ndarray, "y x"]


def read_grid(
    path: Path,
    file: netCDF4.Dataset,
    places: tuple[Places, Places] | None,
    centre: tuple[float, float] | None,
) -> ColumnGrid:
    """Find where the columns of a file are.

    **Arguments:**

    - `places`: latitudes and longitudes of the columns; None where the file has none.
    - `centre`: latitude and longitude of the middle of an ideal run, which has no map.

    **Raises:** `DataError` for a map that WRF has not, without a map or a centre, and
    where the columns do not stand on the map.
    """
    if (
        places is None
        or getattr(file, "MAP_PROJ", None) == 0
        or np.ptp(places[0]) + np.ptp(places[1]) < 1e-9
    ):
        return _ideal(path, file, centre)
    if centre is not None:
        raise DataError(
            f"{path} says where its columns are: a centre is for ideal runs, leave it "
            "out."
        )
    return _placed(path, _projection(path, file, *places), *places)


def _ideal(path: Path, file: netCDF4.Dataset, centre) -> ColumnGrid:
    if centre is None:
        raise DataError(
            f"{path} is an ideal run without a map projection: give the latitude and "
            "longitude of its centre."
        )
    dx, dy = (float(_attribute(path, file, name)) for name in ("DX", "DY"))
    rows, columns = (len(file.dimensions[n]) for n in ("south_north", "west_east"))
    first = -dx * (columns - 1) / 2, -dy * (rows - 1) / 2
    return ColumnGrid(LocalPlane(*centre), first, (dx, dy), (rows, columns))


def _projection(
    path: Path, file: netCDF4.Dataset, latitude: Places, longitude: Places
) -> AbstractMapProjection:
    number = int(_attribute(path, file, "MAP_PROJ"))

    def get(name: str) -> float:
        return float(_attribute(path, file, name))

    # Longitudes count from here, for on these maps none is special.
    middle = float(longitude[longitude.shape[0] // 2, longitude.shape[1] // 2])
    makers: dict[int, Callable[[], AbstractMapProjection]] = {
        1: lambda: ConformalConic.lambert(
            get("TRUELAT1"), get("TRUELAT2"), get("STAND_LON")
        ),
        2: lambda: ConformalConic.polar_stereographic(
            get("TRUELAT1"), get("STAND_LON")
        ),
        3: lambda: Mercator(middle, get("TRUELAT1")),
    }
    if number in makers:
        return makers[number]()
    if number != _LATLON:
        raise DataError(
            f"{path} has the map projection {number}, which WRF does not have: 1 is "
            "Lambert, 2 polar stereographic, 3 Mercator and 6 latitude and longitude."
        )
    pole = float(getattr(file, "POLE_LAT", 90.0))
    if abs(pole) == 90:
        return LatLonMap(middle)
    globe = LatLonMap(0.0, pole, 180 - get("STAND_LON"))
    x, _ = globe.project(latitude.astype(float), longitude.astype(float))
    turned = float(np.degrees(x[x.shape[0] // 2, x.shape[1] // 2] / MODEL_RADIUS_M))
    return LatLonMap(turned, globe.pole_latitude_deg, globe.pole_longitude_deg)


def _placed(
    path: Path, projection: AbstractMapProjection, latitude: Places, longitude: Places
) -> ColumnGrid:
    x, y = projection.project(latitude.astype(float), longitude.astype(float))
    rows, columns = x.shape
    if min(rows, columns) < 2:
        raise DataError(
            f"{path} has a single row of columns: give a file with two or more each "
            "way."
        )
    dx = float((x[:, -1] - x[:, 0]).mean() / (columns - 1))
    dy = float((y[-1] - y[0]).mean() / (rows - 1))
    i, j = np.arange(rows)[:, None], np.arange(columns)[None]
    first = float((x - dx * j).mean()), float((y - dy * i).mean())
    off = np.hypot(x - first[0] - dx * j, y - first[1] - dy * i).max()
    if not off < _TOLERANCE * min(abs(dx), abs(dy)):
        raise DataError(
            f"{path} has columns up to {off / 1e3:.1f} km beside the map that its "
            "attributes name: the file was regridded or its attributes are those of "
            "another, get the wrfout file itself."
        )
    return ColumnGrid(projection, first, (dx, dy), (rows, columns))


def _attribute(path: Path, file: netCDF4.Dataset, name: str):
    if name not in file.ncattrs():
        raise DataError(
            f"{path} lacks the attribute {name}, without which its map projection is "
            "not known: get a whole wrfout file."
        )
    return file.getncattr(name)
