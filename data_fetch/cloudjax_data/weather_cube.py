"""A weather analysis on pressure levels is one kind of object, whatever the file."""

import functools as ft
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime
from os import PathLike
from pathlib import Path

import numpy as np
import xarray as xr
from jaxtyping import Bool, Float

from .errors import DataError
from .grib import read_grib
from .lambert import LambertConic
from .weather_fields import LEVELLESS, REQUIRED, WANTED, assembled
from .weather_grid import on_plain_axes, oriented, places_held
from .weather_sky import MEANS


# Of all columns: so many may end below an altitude that is asked for.
_FEW_COLUMNS = 0.01
# 12 km: what ends below leaves out air that holds clouds.
_LOW_TOP_HPA = 200.0


@dataclass(frozen=True, eq=False)
class WeatherCube:
    """A `WeatherCube` has winds, humidity, temperature and height on pressure levels,
    at one time.

    **Fields:**

    - `data`: variables on `(level, latitude, longitude)` or, on a Lambert map, on
        `(level, y, x)` with `latitude(y, x)` and `longitude(y, x)`:
        `u`, `v` (m/s, to the true east and north), `w` (Pa/s: the change of pressure,
        so **positive is downward**), `r` (%), `t` (K), `gh` (geopotential metres) and,
        where the file has them, `clwmr` and `icmr` (kg/kg, of cloud water and ice) and
        `tcc` (cloud cover, %). On `(latitude, longitude)`, where the
        file has them: `orog`, the height of the ground (geopotential metres); `lsm`,
        the share of land (0 to 1); `t_surface`, the temperature of the skin of ground
        or sea (K); `t_2m`, of the air at 2 m (K); and what `weather_sky.SKY` lists.
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
    - `means`: variables that are means over the hours before.
    """

    data: xr.Dataset
    valid_time: datetime
    path: Path
    lost_levels_hpa: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    projection: LambertConic | None = None
    means: frozenset[str] = frozenset()

    @property
    def is_global(self) -> bool:
        """Tell whether it goes all the way round, and to both poles but for a cell."""
        if self.projection is not None:
            return False
        longitude, latitude = (
            self.data[axis].to_numpy() for axis in ("longitude", "latitude")
        )
        step = longitude[1] - longitude[0]
        around = np.isclose(longitude[-1] + step - longitude[0], 360.0)
        cell = 1.001 * (latitude[1] - latitude[0])
        return bool(around and latitude[-1] + cell >= 90 and latitude[0] - cell <= -90)

    @ft.cached_property
    def known_columns(self) -> Bool[np.ndarray, "y x"]:
        """Tell in which columns every required variable is given on two levels."""
        height = np.isfinite(self.data["gh"].to_numpy())
        counts = [
            (height & np.isfinite(self.data[name].to_numpy())).sum(axis=0)
            for name in REQUIRED
            if name in self.data
        ]
        return np.min(counts, axis=0) >= 2

    def holds(
        self,
        latitude_deg: Float[np.ndarray, "*places"],
        longitude_deg: Float[np.ndarray, "*places"],
    ) -> Bool[np.ndarray, "*places"]:
        """Tell which places are among known columns of the grid."""
        return places_held(
            self.data, self.projection, self.known_columns, latitude_deg, longitude_deg
        )

    @property
    def extent(self) -> str:
        """Say in words what part of the Earth it covers."""
        φ, λ = (self.data[axis].to_numpy() for axis in ("latitude", "longitude"))
        if self.is_global:
            return "the whole Earth"
        return (
            f"latitudes {φ.min():.4g} to {φ.max():.4g} and longitudes {λ.min():.4g} to "
            f"{λ.max():.4g}"
        )

    @property
    def notes(self) -> tuple[str, ...]:
        """Say what it lacks, in sentences."""
        name, levels = self.path.name, self.data["level"].to_numpy()
        lost = {p for held in self.lost_levels_hpa.values() for p in held}
        said = []
        for level in sorted((p for p in lost if p > levels[-1]), reverse=True):
            lacking = [
                variable
                for variable in REQUIRED
                if level not in self.lost_levels_hpa.get(variable, ())
            ]
            said.append(
                f"{name} lacks {', '.join(lacking)} at {level:g} hPa: nothing is taken "
                "from that level."
            )
        if levels[-1] > _LOW_TOP_HPA:
            said.append(
                f"{name} ends at {levels[-1]:g} hPa: the air above is that of the "
                "standard atmosphere."
            )
        return tuple(said)

    def at_altitude(self, altitude_m: float) -> xr.Dataset:
        """Interpolate the variables on levels (but `gh`) to a height above sea level.

        The height is in geopotential metres (geometric height is greater by 0.16 % at
        10 km). Linear between the two levels next to it at which the variable is given,
        column by column; NaN below the ground or the lowest level, and above the
        highest level.
        """
        height = self.data["gh"].to_numpy()
        columns = self.data.drop_vars(["gh", *LEVELLESS], errors="ignore")
        whole = _bracket(height, altitude_m)
        found = {}
        for name, values in columns.data_vars.items():
            field = values.to_numpy()
            bracket = whole
            if name not in self._whole:
                given = np.where(np.isfinite(field), height, np.nan)
                bracket = _bracket(given, altitude_m)
            column = values.isel(level=0, drop=True)
            found[name] = column.copy(data=_between(field, *bracket))
        result = columns.drop_dims("level").assign(found)
        if "orog" in self.data:
            ground = self.data["orog"]
            result = result.where(~(ground.drop_vars(ground.coords) > altitude_m))
        return result.assign_coords(altitude_m=altitude_m)

    @ft.cached_property
    def _whole(self) -> frozenset[str]:
        """The variables that are given wherever the height of the level is."""
        height = np.isfinite(self.data["gh"].to_numpy())
        return frozenset(
            str(name)
            for name, values in self.data.data_vars.items()
            if "level" in values.dims and np.isfinite(values.to_numpy())[height].all()
        )

    def regular(self, step_deg: float) -> "WeatherCube":
        """Return this cube on regular latitudes and longitudes, multiples of
        `step_deg`.

        Linear on the map; NaN outside of it. A cube that is already on latitude and
        longitude is returned as it is.
        """
        if self.projection is None:
            return self
        data = on_plain_axes(self.data, self.projection, step_deg)
        return replace(self, data=data, projection=None)


def read_weather(path: str | PathLike[str]) -> WeatherCube:
    """Read a GFS or NAM file, GRIB2 or GRIB1, global or regional.

    **Raises:** `DataError` if the file is absent, damaged, of several times or members,
    on a grid other than latitude-longitude or Lambert, contradicts itself, lacks a
    meridian, lacks one of `REQUIRED` on pressure levels, or has one in other units,
    with impossible values or twice.
    """
    path = Path(path)
    found = assembled(path, read_grib(path, WANTED, MEANS))
    data = oriented(path, found.data, found.projection, found.winds_along_grid)
    data.attrs = {"source": path.name}
    return WeatherCube(
        data,
        found.valid_time,
        path,
        found.lost_levels_hpa,
        found.projection,
        found.means,
    )


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
    """Raise `DataError` if columns end below an altitude, or most have nothing there
    above ground.
    """
    data = cube.data
    height = data["gh"].to_numpy()
    above_ground = np.ones(height.shape[1:], bool)
    if "orog" in data:
        above_ground = data["orog"].to_numpy() < altitude_m
    known = np.isfinite(cube.at_altitude(altitude_m)["r"].to_numpy())
    top = np.where(np.isfinite(height), height, -np.inf).max(axis=0)
    beyond = np.isfinite(top) & (top < altitude_m)
    if (
        known.sum() < 0.5 * above_ground.sum()
        or not known.any()
        or beyond.mean() > _FEW_COLUMNS
    ):
        levels = data["level"].to_numpy()
        raise DataError(
            f"{cube.path} has nothing at {altitude_m:g} m for many places: all of "
            f"{', '.join(REQUIRED)} are given only from {levels[0]:g} to "
            f"{levels[-1]:g} hPa, get a file with more levels."
        )


def _bracket(
    height: np.ndarray, altitude: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """By column, the levels next to an altitude and the weight of the upper one.

    Levels without a height do not count. The weight is NaN where the altitude is not
    between two levels.
    """
    below, above = height <= altitude, height >= altitude
    lower = height.shape[0] - 1 - np.argmax(below[::-1], axis=0)[None]
    upper = np.argmax(above, axis=0)[None]
    bottom = np.take_along_axis(height, lower, axis=0)[0]
    top = np.take_along_axis(height, upper, axis=0)[0]
    apart = np.where(top > bottom, top - bottom, 1)
    enclosed = below.any(axis=0) & above.any(axis=0)
    return lower, upper, np.where(enclosed, (altitude - bottom) / apart, np.nan)


def _between(
    values: np.ndarray, lower: np.ndarray, upper: np.ndarray, weight: np.ndarray
) -> np.ndarray:
    below = np.take_along_axis(values, lower, axis=0)[0]
    above = np.take_along_axis(values, upper, axis=0)[0]
    # What is not given has no share in a level that the altitude meets.
    above = np.where(upper[0] == lower[0], below, above)
    return below + weight * (above - below)
