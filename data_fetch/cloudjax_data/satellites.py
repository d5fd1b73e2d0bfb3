"""Each GOES-R satellite stood in a position for some time.

NOAA declared a satellite operational on these dates (docs/guides/fetch.md has sources).
"""

from datetime import UTC, datetime

from .errors import DataError


SATELLITES = ("goes16", "goes17", "goes18", "goes19")

# since when; each until the next one
POSITIONS = {
    "east": (
        (datetime(2017, 12, 18, tzinfo=UTC), "goes16"),
        (datetime(2025, 4, 7, tzinfo=UTC), "goes19"),
    ),
    "west": (
        (datetime(2019, 2, 12, tzinfo=UTC), "goes17"),
        (datetime(2023, 1, 4, tzinfo=UTC), "goes18"),
    ),
}


def in_utc(time: datetime) -> datetime:
    """Return the same time in UTC, or raise `DataError` if it has no time zone."""
    if time.tzinfo is None:
        raise DataError(f"{time} has no time zone: give it one, such as datetime.UTC.")
    return time.astimezone(UTC)


def satellite_at(name: str, time: datetime) -> str:
    """Return the satellite of that name, or the one that stood in that position.

    **Arguments:**

    - `name`: "goes16" to "goes19", or "east" or "west".
    - `time`: in UTC; matters to positions only.

    **Raises:** `DataError` for any other name, and for a position before the first
    satellite of the series took it.
    """
    if name in SATELLITES:
        return name
    if name not in POSITIONS:
        known = ", ".join((*SATELLITES, *POSITIONS))
        raise DataError(f"{name!r} is no satellite of the series: use one of {known}.")
    held = [who for since, who in POSITIONS[name] if since <= time]
    if not held:
        since, who = POSITIONS[name][0]
        raise DataError(
            f"No satellite of the series was GOES-{name.capitalize()} on "
            f"{time:%Y-%m-%d}, the first one took over on {since:%Y-%m-%d}: choose a "
            f"later time, or ask for {who} by name where it was on trial."
        )
    return held[-1]


def position_at(satellite: str, time: datetime) -> str | None:
    """Return "east" or "west" if the satellite stood there, else None.

    **Arguments:** `satellite`: "goes16" to "goes19"; `time`: in UTC.
    """
    for position, held in POSITIONS.items():
        since = [who for start, who in held if start <= time]
        if since and since[-1] == satellite:
            return position
    return None
