"""Weather at several times is linear in between."""

import itertools as it
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np
from jaxtyping import Float

from .errors import DataError
from .weather_cube import WeatherCube


# Of a degree: grids differ by rounding only.
_SAME_DEG = 1e-4


@dataclass(frozen=True, eq=False)
class WeatherSeries:
    """A `WeatherSeries` holds cubes on one grid, in the order of their times.

    Their levels may differ, for everything is taken at altitudes. Build it with
    `WeatherSeries.of`.
    """

    cubes: tuple[WeatherCube, ...]

    @staticmethod
    def of(cubes: Sequence[WeatherCube]) -> "WeatherSeries":
        """Make the series of these cubes, in any order.

        **Raises:** `DataError` if there are none, two are of the same time, or their
        grids differ.
        """
        ordered = tuple(sorted(cubes, key=lambda cube: cube.valid_time))
        if not ordered:
            raise DataError("A series of weather needs one file at least: add one.")
        first = ordered[0]
        for one, following in it.pairwise(ordered):
            if one.valid_time == following.valid_time:
                raise DataError(
                    f"{one.path} and {following.path} are both valid at "
                    f"{one.valid_time:%Y-%m-%d %H:%M} UTC: keep one of them."
                )
            if not _same_grid(first, following):
                raise DataError(
                    f"{first.path} and {following.path} are on different grids: get "
                    "files of one resolution and region."
                )
        return WeatherSeries(ordered)

    @property
    def times(self) -> tuple[datetime, ...]:
        """Give the times, ascending, in UTC."""
        return tuple(cube.valid_time for cube in self.cubes)

    def seconds_from(self, origin: datetime) -> Float[np.ndarray, " time"]:
        """Return the times in seconds after another."""
        return np.array([(time - origin).total_seconds() for time in self.times])

    def winds(
        self, altitude_m: float
    ) -> tuple[Float[np.ndarray, "time y x"], Float[np.ndarray, "time y x"]]:
        """Return eastward and northward wind [m/s] at an altitude, at `times`.

        As `WeatherCube.at_altitude`, NaN under the ground and beyond the levels.
        """
        levels = [cube.at_altitude(altitude_m) for cube in self.cubes]
        east, north = (
            np.stack([level[name].to_numpy() for level in levels]) for name in "uv"
        )
        return east, north

    def weights(self, time: datetime) -> list[tuple[int, float]]:
        """Return the analyses next to a time, by index, and how much each counts.

        Weights are linear in time and add up to 1. Before the first and after the last
        time, that one counts alone.
        """
        seconds = self.seconds_from(time)
        after = int(np.searchsorted(seconds, 0.0))
        last = len(seconds) - 1
        if after in (0, last + 1) or seconds[after] == 0:
            return [(min(after, last), 1.0)]
        weight = float(-seconds[after - 1] / (seconds[after] - seconds[after - 1]))
        return [(after - 1, 1 - weight), (after, weight)]


def _same_grid(one: WeatherCube, other: WeatherCube) -> bool:
    return one.projection == other.projection and all(
        one.data[axis].shape == other.data[axis].shape
        and np.allclose(one.data[axis], other.data[axis], rtol=0, atol=_SAME_DEG)
        for axis in ("latitude", "longitude")
    )
