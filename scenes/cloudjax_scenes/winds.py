"""The air of a time has come from elsewhere, in stills and in films.

Clouds stand where an analysis has them once its air has come there, and are drawn from
noise that the wind has carried. In a film noise that is carried on and on would end as
threads, so that each texture is seen in two generations: one fades while the other
grows, and a generation begins anew where it is not seen.
"""

import itertools as it
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta

import numpy as np

from cloudjax import (
    AbstractMask,
    BlendedMask,
    CloudClass,
    DisplacementMap,
    DrawnMask,
    Generation,
    TurnedMap,
    Wind,
    displacement_map,
    propagate,
)
from cloudjax_data import WeatherSeries

from .weather_analysis import MAP_STEP_DEG, wind_at


# An altitude in metres, and for how many hours the wind draws what is there.
Drawn = tuple[float, float]

# As that of a fresh map of 20 hours.
_STEP_MINUTES = 30.0
# A texture that the wind has hardly drawn lives as long in films as one of so long.
_LEAST_HOURS = 2.0
# By which generations are turned about the Earth's axis, so that none comes twice.
_GOLDEN_ANGLE = math.pi * (3 - math.sqrt(5))


@dataclass(frozen=True, eq=False)
class Origin:
    """An `Origin` is an analysis from which the clouds of a time have come.

    **Fields:** `index`: in the series; `weight`: the weights of all add up to 1;
    `maps`: by altitude [m], from where air is to where the analysis has it, none at
    the analysis's own time.
    """

    index: int
    weight: float
    maps: Mapping[float, DisplacementMap]


@dataclass(frozen=True, eq=False)
class Winds:
    """`Winds` tell where the air of one time has come from.

    **Fields:** `origins`: one analysis, or those before and after; `masks`, `textures`:
    how masks and textures are drawn beside.
    """

    origins: tuple[Origin, ...]
    masks: Mapping[Drawn, DisplacementMap] = field(default_factory=dict)
    textures: Mapping[Drawn, tuple[Generation, ...]] = field(default_factory=dict)

    def carried(
        self, of_analyses: Sequence[AbstractMask], altitude_m: float, hours: float
    ) -> AbstractMask:
        """Give what the analyses have at this time, where the wind has brought it.

        Each is carried before they are blended, so that a cloud of both is one cloud.

        **Arguments:** `of_analyses`: of each of the series; `hours`: for which the wind
        draws the whole.
        """
        parts = [
            DrawnMask(of_analyses[one.index], one.maps[altitude_m])
            if one.maps
            else of_analyses[one.index]
            for one in self.origins
        ]
        weights = np.array([one.weight for one in self.origins])
        whole = parts[0] if len(parts) == 1 else BlendedMask(tuple(parts), weights)
        drawn = self.masks.get((altitude_m, hours))
        return whole if drawn is None else DrawnMask(whole, drawn)

    def generations(self, one: CloudClass) -> list[tuple[Generation, ...]]:
        """Give, for each texture of a class, the generations in which it is seen."""
        still = (Generation(1.0, None),)
        return [
            self.textures.get((_altitude_m(one), texture.displacement_hours), still)
            for texture in one.textures
        ]


@dataclass(frozen=True, eq=False)
class AirMotion:
    """`AirMotion` finds winds for the classes of a world."""

    series: WeatherSeries
    classes: Collection[CloudClass]

    def still(self, time: datetime) -> Winds:
        """Find how the winds have moved the clouds of one time."""
        textures = {
            (z, hours): (Generation(1.0, self._still(z, time, hours)),)
            for z, hours in self._textures()
            if hours > 0
        }
        return Winds(self._origins(time), self._masks(time), textures)

    def frames(
        self, start: datetime, count: int, minutes: float
    ) -> Iterator[tuple[datetime, Winds]]:
        """Give times and winds of a film, whose first frame is the still."""
        lives = {
            drawn: [self._life(drawn, start, minutes, first) for first in (0.5, 0.0)]
            for drawn in self._textures()
        }
        for i in range(count):
            time = start + timedelta(minutes=i * minutes)
            textures = {drawn: tuple(map(next, both)) for drawn, both in lives.items()}
            yield time, Winds(self._origins(time), self._masks(time), textures)

    def _life(
        self, drawn: Drawn, start: datetime, minutes: float, first: float
    ) -> Iterator[Generation]:
        """Of a texture, one generation after the other; each begins and ends unseen,
        and is as old in the middle of its life as that of a still.

        **Arguments:** `first`: the part of its life that the first one has behind it.
        """
        altitude, hours = drawn
        wind = wind_at(self.series, altitude, start)
        period = 2 * max(hours, _LEAST_HOURS)
        number, carried = None, None
        for i in it.count():
            hours_on = i * minutes / 60
            lives, part = divmod(hours_on / period + first, 1)
            if carried is not None and lives == number:
                steps = math.ceil(minutes / _STEP_MINUTES)
                span = 60 * minutes
                carried = propagate(carried, wind, duration_s=span, steps=steps)
            else:
                age = hours + (part - 0.5) * period
                number, carried = lives, _map(wind, age, 3600 * hours_on)
            turned = TurnedMap.of(carried, lives * _GOLDEN_ANGLE)
            yield Generation(math.sin(math.pi * part), turned)

    def _origins(self, time: datetime) -> tuple[Origin, ...]:
        return tuple(
            Origin(i, weight, self._since(self.series.times[i], time))
            for i, weight in self.series.weights(time)
        )

    def _since(self, then: datetime, time: datetime) -> Mapping[float, DisplacementMap]:
        hours = (time - then).total_seconds() / 3600
        if hours == 0:
            return {}
        return {z: self._still(z, time, hours) for z in sorted(self._altitudes())}

    def _masks(self, time: datetime) -> Mapping[Drawn, DisplacementMap]:
        found = {
            (_altitude_m(one), one.mask_displacement_hours) for one in self.classes
        }
        return {(z, h): self._still(z, time, h) for z, h in sorted(found) if h > 0}

    def _textures(self) -> list[Drawn]:
        return sorted(
            {
                (_altitude_m(one), texture.displacement_hours)
                for one in self.classes
                for texture in one.textures
            }
        )

    def _altitudes(self) -> set[float]:
        return {_altitude_m(one) for one in self.classes}

    def _still(self, altitude_m: float, time: datetime, hours: float):
        return _map(wind_at(self.series, altitude_m, time), hours)


def _altitude_m(one: CloudClass) -> float:
    return float(one.conditions.sampling_altitude_m)


def _map(wind: Wind, hours: float, time_s: float = 0.0) -> DisplacementMap:
    return displacement_map(
        wind,
        hours=hours,
        time_s=time_s,
        resolution_deg=MAP_STEP_DEG,
        steps=_map_steps(abs(hours)),
    )


def _map_steps(hours: float) -> int:
    """Of some half an hour; of few different numbers, for each is compiled anew."""
    return next((n for n in (10, 20) if hours <= 0.6 * n), 40)
