"""Scenes on which promises of fronts are put to the test."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from benchmarks.fronts import geostationary, low_orbit

from cloudjax_scenes.sensors import Sensor


@dataclass(frozen=True)
class Case:
    """A sensor at some hours from the analysis, of which an error is asked."""

    sensor: Sensor
    bands: tuple[int, ...]
    hours: float
    max_error: float


@dataclass(frozen=True)
class _Group:
    """Sensors with pixels and bands alike, which share what is compiled.

    **Fields:** `hours`: from the analysis, at noon UTC, in turns.
    """

    bands: tuple[int, ...]
    sensors: Sequence[Sensor]
    hours: tuple[float, ...] = (0.0,)

    def cases(self) -> Iterator[Case]:
        for i, sensor in enumerate(self.sensors):
            hours = self.hours[i % len(self.hours)]
            yield Case(sensor, self.bands, hours, _ERRORS[i % len(_ERRORS)])


_ERRORS = 0.05, 0.15


def cases() -> Iterator[Case]:
    """Yield all cases."""
    for group in _GROUPS:
        yield from group.cases()


def _sectors(name: str, *places: tuple[float, float, float]) -> list[Sensor]:
    """Sectors by where their satellite stands, and latitude and longitude of each."""
    return [geostationary(name, above, (lat, lon)) for above, lat, lon in places]


def _narrow(latitude_deg: float, longitude_deg: float) -> Sensor:
    return low_orbit(
        latitude_deg, longitude_deg, altitude_m=400e3, field_of_view_deg=10.0
    )


# Sea and land, deep convection, stratocumulus and clear desert; the sides of day, of
# night and the border between them.
_GROUPS = (
    _Group(
        (2, 13),
        _sectors(
            "abi-meso-2km",
            (0.0, -12.0, 15.0),
            (0.0, 48.0, -10.0),
            (60.0, -20.0, 50.0),
            (0.0, 24.0, 10.0),
        ),
        hours=(0.0, 2.5),
    ),
    _Group(
        (7, 8, 14),
        _sectors(
            "abi-meso-2km",
            (-75.0, -5.0, -65.0),
            (140.0, -5.0, 135.0),
            (140.0, 30.0, 150.0),
            (-137.0, 35.0, -135.0),
        ),
    ),
    _Group(
        (1, 3, 13),
        _sectors(
            "abi-meso-1km",
            (0.0, 40.0, -20.0),
            (0.0, -25.0, 0.0),
            (-30.0, 5.0, -30.0),
            (60.0, -10.0, 70.0),
        ),
        hours=(-2.5, 0.0),
    ),
    _Group(
        (15,),
        _sectors(
            "abi-meso-1km",
            (-75.0, 30.0, -60.0),
            (140.0, 0.0, 150.0),
            (-137.0, -15.0, -120.0),
            (90.0, 25.0, 90.0),
        ),
    ),
    _Group(
        (2, 13),
        [geostationary("abi-conus-4km", lon) for lon in (0.0, -60.0, 45.0, -15.0)],
        hours=(0.0, 3.0),
    ),
    _Group(
        (8, 13, 16),
        [geostationary("abi-conus-4km", lon) for lon in (-75.0, 140.0, -137.0, 90.0)],
    ),
    _Group(
        (2,),
        _sectors(
            "abi-meso-0.5km",
            (0.0, -15.0, -10.0),
            (0.0, 45.0, 5.0),
            (-30.0, 0.0, -20.0),
            (60.0, 10.0, 75.0),
        ),
    ),
    _Group(
        (4, 6, 13),
        [
            low_orbit(-30.0, -10.0),
            low_orbit(40.0, -30.0),
            low_orbit(0.0, 20.0),
            low_orbit(55.0, 10.0),
            low_orbit(-50.0, 20.0),
            low_orbit(15.0, 5.0),
            low_orbit(25.0, -60.0),
        ],
        hours=(0.0, -3.0),
    ),
    _Group(
        (11, 13),
        [
            _narrow(20.0, 120.0),
            _narrow(-10.0, -70.0),
            _narrow(30.0, -150.0),
            _narrow(-45.0, 30.0),
        ],
    ),
    _Group(
        (2, 13),
        [geostationary("abi-fulldisk-10km", lon) for lon in (-40.0, 75.0, 30.0)],
        hours=(0.0, -3.0),
    ),
    _Group(
        (10, 14),
        [geostationary("abi-fulldisk-10km", lon) for lon in (140.0, -137.0, -75.0)],
    ),
)
# Of scenes from imagery: those sets that a folder has.
IMAGERY_BANDS = (1, 3, 13), (13,), (5, 7, 15), (3, 11), (8, 11, 15), (7, 14)
