"""A weather analysis on pressure levels is one kind of object, whatever the file."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from os import PathLike
from pathlib import Path

import numpy as np
import xarray as xr

from .errors import DataError
from .grib import read_grib
from .lambert import LambertConic
from .weather_grid import on_plain_axes, oriented


# short name: units, as eccodes spells them
REQUIRED = {
    "u": "m s**-1",
    "v": "m s**-1",
    "w": "Pa s**-1",
    "r": "%",
    "t": "K",
    "gh": "gpm",
}
OPTIONAL = {"clwmr": "kg kg**-1"}
# name in the cube: type of level and short name in the file
GROUND = {
    "orog": ("surface", "orog"),
    "lsm": ("surface", "lsm"),
    "t_surface": ("surface", "t"),
    "t_2m": ("heightAboveGround", "2t"),
}

_LEVEL = "isobaricInhPa"
# Far beyond any weather: what lies outside is a number that stands for "missing".
_POSSIBLE = {
    "u": (-300.0, 300.0),
    "v": (-300.0, 300.0),
    "w": (-200.0, 200.0),
    "r": (-50.0, 250.0),
    "t": (0.0, 500.0),
    "gh": (-5e3, 100e3),
    "t_surface": (0.0, 500.0),
    "t_2m": (0.0, 500.0),
    "lsm": (-0.01, 1.01),
    "orog": (-1e3, 10e3),
}


@dataclass(frozen=True, eq=False)
class WeatherCube:
    """A `WeatherCube` has winds, humidity, temperature and height on pressure levels,
    at one time.

    **Fields:**

    - `data`: variables on `(level, latitude, longitude)` or, on a Lambert map, on
        `(level, y, x)` with `latitude(y, x)` and `longitude(y, x)`:
        `u`, `v` (m/s, to the true east and north), `w` (Pa/s: the change of pressure,
        so **positive is downward**), `r` (%), `t` (K), `gh` (geopotential metres) and,
        where the file has it, `clwmr` (kg/kg). On `(latitude, longitude)`, where the
        file has them: `orog`, the height of the ground (geopotential metres); `lsm`,
        the share of land (0 to 1); `t_surface`, the temperature of the skin of ground
        or sea (K); `t_2m`, of the air at 2 m (K).
        `level` is in hPa and descends, from the ground upward. `latitude` ascends.
        `longitude` is east positive and ascends from a value in [0, 360); a global grid
        starts next to 0, a region across Greenwich goes on beyond 360. On a Lambert map
        longitudes are within 180 degrees of its central meridian. Where a field is
        masked in the file, such as under the ground, it is NaN.
    - `valid_time`: in UTC.
    - `path`: the file.
    - `lost_levels_hpa`: by variable, the levels that it has in the file but not all
        required variables have, and that are dropped. A level on which a variable is
        masked everywhere is one that it has not.
    - `projection`: the Lambert map, or None on latitude and longitude.
    """

    data: xr.Dataset
    valid_time: datetime
    path: Path
    lost_levels_hpa: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    projection: LambertConic | None = None

    @property
    def is_global(self) -> bool:
        """Tell whether longitudes go all the way round."""
        if self.projection is not None:
            return False
        longitude = self.data["longitude"].to_numpy()
        step = longitude[1] - longitude[0]
        return bool(np.isclose(longitude[-1] + step - longitude[0], 360.0))

    def at_altitude(self, altitude_m: float) -> xr.Dataset:
        """Interpolate the variables on levels (but `gh`) to a height above sea level.

        The height is in geopotential metres (geometric height is greater by 0.16 % at
        10 km). Linear between the two levels that enclose it, column by column; NaN
        below the ground or the lowest level, and above the highest level.
        """
        lower, weight = _bracket(self.data["gh"].to_numpy(), altitude_m)
        if "orog" in self.data:
            ground = self.data["orog"].to_numpy()
            weight = np.where(altitude_m < ground, np.nan, weight)
        columns = self.data.drop_vars(["gh", *GROUND], errors="ignore")
        return columns.map(_between, args=(lower, weight)).assign_coords(
            altitude_m=altitude_m
        )

    def regular(self, step_deg: float) -> "WeatherCube":
        """Return this cube on regular latitudes and longitudes, multiples of
        `step_deg`.

        Linear on the map; NaN outside of it. A cube that is already on latitude and
        longitude is returned as it is.
        """
        if self.projection is None:
            return self
        data = on_plain_axes(self.path, self.data, self.projection, step_deg)
        return replace(self, data=data, projection=None)


def read_weather(path: str | PathLike[str]) -> WeatherCube:
    """Read a GFS or NAM file, GRIB2 or GRIB1, global or regional.

    **Raises:** `DataError` if the file is absent, corrupt, of several times, on a grid
    other than latitude-longitude or Lambert, lacks a meridian, lacks one of `REQUIRED`
    on pressure levels, or has one in other units or with impossible values.
    """
    path = Path(path)
    units = REQUIRED | OPTIONAL
    names = [(_LEVEL, name) for name in (*units, "wz")]
    found = read_grib(path, [*names, *GROUND.values()])
    _require_all(path, {name for level, name in found if level == _LEVEL})
    fields = {
        name: _checked(path, name, units[name], found[_LEVEL, name])
        for name in units
        if (_LEVEL, name) in found
    }
    data, lost = _aligned(path, fields)
    ground = [
        _plain(found[key]).rename(name) for name, key in GROUND.items() if key in found
    ]
    data = _merged(path, [data, *ground])
    _require_possible(path, data)
    data, projection = oriented(path, data, fields["u"].attrs)
    data.attrs = {"source": path.name}
    times = {_valid_time(values) for values in fields.values()}
    if len(times) > 1:
        raise DataError(f"{path} holds several times: keep the messages of one.")
    return WeatherCube(data, times.pop(), path, lost, projection)


def check_time(
    scene_time: datetime, cube: WeatherCube, allowed_hours: float = 3.0
) -> None:
    """Raise `DataError` if the weather is further from the imagery than allowed."""
    apart = abs((cube.valid_time - scene_time).total_seconds()) / 3600
    if apart > allowed_hours:
        raise DataError(
            f"{cube.path} is valid at {cube.valid_time:%Y-%m-%d %H:%M} UTC, "
            f"{apart:.1f} hours from the imagery of {scene_time:%Y-%m-%d %H:%M} UTC: "
            "get the analysis nearest to the scan, or allow "
            f"more than {allowed_hours:g} hours."
        )


def check_altitude(cube: WeatherCube, altitude_m: float) -> None:
    """Raise `DataError` if most columns have no weather at an altitude above ground."""
    data = cube.data
    above_ground = np.ones(data["gh"].shape[1:], bool)
    if "orog" in data:
        above_ground = data["orog"].to_numpy() < altitude_m
    known = np.isfinite(cube.at_altitude(altitude_m)["r"].to_numpy())
    if known.sum() < 0.5 * above_ground.sum() or not known.any():
        levels = data["level"].to_numpy()
        raise DataError(
            f"{cube.path} has nothing at {altitude_m:g} m for most places: all of "
            f"{', '.join(REQUIRED)} are given only from {levels[0]:g} to "
            f"{levels[-1]:g} hPa, get a file with more levels."
        )


def _require_possible(path: Path, data: xr.Dataset) -> None:
    for name, (low, high) in _POSSIBLE.items():
        if name not in data:
            continue
        values = data[name].to_numpy()
        wrong = values[(values < low) | (values > high)]
        if wrong.size:
            raise DataError(
                f"{path} has {name!r} of {wrong[0]:g} at {wrong.size} points: what is "
                "missing must be masked, download it again."
            )


def _require_all(path: Path, found: set[str]) -> None:
    missing = [name for name in REQUIRED if name not in found]
    if missing == ["w"] and "wz" in found:
        raise DataError(
            f"{path} has the vertical velocity in m/s ('wz') and not in Pa/s ('w'): "
            "get the pressure vertical velocity (VVEL) too."
        )
    if missing:
        raise DataError(
            f"{path} has no {', '.join(map(repr, missing))} on pressure levels: get a "
            f"file with {', '.join(REQUIRED)}."
        )


def _checked(path: Path, name: str, units: str, found: xr.DataArray) -> xr.DataArray:
    given = found.attrs["GRIB_units"]
    if given != units:
        raise DataError(
            f"{path} has {name!r} in {given!r} instead of {units!r}: get the file from "
            "the GFS or NAM."
        )
    if not np.isfinite(found).any():
        raise DataError(f"{path} has {name!r} all masked: download it again.")
    # a single level comes as a scalar coordinate
    found = found if _LEVEL in found.dims else found.expand_dims(_LEVEL)
    return found.dropna(_LEVEL, how="all").sortby(_LEVEL, ascending=False)


def _aligned(
    path: Path, fields: dict[str, xr.DataArray]
) -> tuple[xr.Dataset, dict[str, tuple[float, ...]]]:
    """All variables on the levels that every required one has."""
    held = {name: set(values[_LEVEL].to_numpy()) for name, values in fields.items()}
    common = set.intersection(*(held[name] for name in REQUIRED))
    if len(common) < 2:
        raise DataError(
            f"{path} has fewer than two pressure levels on which all of "
            f"{', '.join(REQUIRED)} are given: get a file with more levels."
        )
    levels = np.array(sorted(common, reverse=True))
    # an optional variable is NaN on a level of its own gap
    plain = (
        _plain(values).reindex({_LEVEL: levels}).rename(name)
        for name, values in fields.items()
    )
    data = _merged(path, plain).rename({_LEVEL: "level"})
    data["level"].attrs = {"units": "hPa", "positive": "down", "axis": "Z"}
    lost = {
        name: tuple(float(level) for level in sorted(held[name] - common, reverse=True))
        for name in fields
    }
    return data, lost


def _merged(path: Path, parts: Iterable[xr.DataArray | xr.Dataset]) -> xr.Dataset:
    try:
        # exact, because xarray would else fill the gaps between two grids with NaN
        return xr.merge(parts, join="exact", compat="override")
    except ValueError as error:
        raise DataError(
            f"{path} has variables on different grids: keep the messages of one."
        ) from error


def _plain(values: xr.DataArray) -> xr.DataArray:
    """Without the coordinates and attributes that only describe the GRIB encoding."""
    kept = {_LEVEL, "latitude", "longitude"}
    values = values.drop_vars(set(values.coords) - kept).copy(deep=False)
    described = ("long_name", "standard_name", "units")
    values.attrs = {k: values.attrs[k] for k in described if k in values.attrs}
    return values


def _valid_time(values: xr.DataArray) -> datetime:
    seconds = values["valid_time"].to_numpy().astype("datetime64[s]").astype(int)
    return datetime.fromtimestamp(int(seconds), UTC)


def _bracket(height: np.ndarray, altitude: float) -> tuple[np.ndarray, np.ndarray]:
    """By column, the level below an altitude and the weight of the one above it.

    The weight is NaN where the altitude is not between two levels.
    """
    count = height.shape[0]
    # the last level below, rather than the number of levels below: those under the
    # ground may be masked
    last = count - 1 - np.argmax((height <= altitude)[::-1], axis=0)
    lower = np.minimum(last, count - 2)[None]
    bottom = np.take_along_axis(height, lower, axis=0)[0]
    top = np.take_along_axis(height, lower + 1, axis=0)[0]
    weight = (altitude - bottom) / (top - bottom)
    return lower, np.where((weight >= 0) & (weight <= 1), weight, np.nan)


def _between(
    values: xr.DataArray, lower: np.ndarray, weight: np.ndarray
) -> xr.DataArray:
    below = np.take_along_axis(values.to_numpy(), lower, axis=0)[0]
    above = np.take_along_axis(values.to_numpy(), lower + 1, axis=0)[0]
    column = values.isel(level=0, drop=True)
    return column.copy(data=below + weight * (above - below))
