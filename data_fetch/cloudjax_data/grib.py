"""GRIB files are read field by field, in one pass.

Everything that a field depends on is asked of its own message: a file may hold several
grids, orders of points, times and members, and what differs must not be mixed.
"""

from collections.abc import Collection, Generator, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float32

from .errors import DataError
from .grib_grid import GribGrid, grid_of
from .grib_messages import message_offsets
from .grib_packing import require_values
from .grib_sections import BrokenMessageError


PRESSURE = "isobaricInhPa"

# Where eccodes names levels that are no whole number of hectopascals.
_PASCALS = "isobaricInPa"
# More than any pressure needs.
_DIGITS = 9
# Greater than anything that a field may hold.
_MISSING = float(np.finfo(np.float32).max)
# Analyses, forecasts, members of ensembles (GRIB 2, code table 4.0), and their means.
_PLAIN_TEMPLATES = (0, 1)
_OF_ENSEMBLES = 2
_MEANS = (0, 1)
# Processes that do not give the field itself (code table 4.3): probabilities, errors.
_NO_FIELDS = (5, 6, 7)
_ERRORS_GRIB1 = ("es", "ses", "tf", "pd", "efi", "bf")


@dataclass(frozen=True, eq=False)
class GribField:
    """A `GribField` is one field of a file, at one level.

    **Fields:**

    - `level_type`, `name`, `units`: as eccodes has them; levels given in Pa are of the
        type of those in hPa.
    - `level`: in hPa on pressure levels.
    - `start`, `valid_time`: of the forecast, and when the field holds, in UTC.
    - `member`: of an ensemble, None without one.
    - `grid`: its places.
    - `winds_along_grid`: whether winds are along the axes of the grid, and not to the
        true east and north.
    - `values`: [row, column], rows from the south, columns from the west; NaN where the
        file has none.
    - `mean_hours`: over so many hours up to its time it is a mean; 0 for a value of the
        time itself.
    """

    level_type: str
    name: str
    units: str
    level: float
    start: datetime
    valid_time: datetime
    member: int | None
    grid: GribGrid
    winds_along_grid: bool
    values: Float32[np.ndarray, "rows columns"]
    mean_hours: float = 0.0

    @property
    def is_mean(self) -> bool:
        """Whether it is a mean over time."""
        return self.mean_hours > 0


@dataclass(frozen=True, eq=False)
class GribFields:
    """`GribFields` are those of a file that were asked for.

    **Fields:**

    - `fields`: in the order of the file.
    - `other_kinds`: types of level and names that were asked for, of fields that are
        averages over time, spreads, probabilities or errors, which are left out.
    """

    fields: tuple[GribField, ...]
    other_kinds: frozenset[tuple[str, str]]


def read_grib(
    path: Path,
    wanted: Collection[tuple[str, str]],
    means: Collection[tuple[str, str]] = (),
) -> GribFields:
    """Read the fields of some types of level and GRIB short names.

    **Arguments:** `means`: of which of them means over time are read as well.

    **Raises:** `DataError` if the file is absent, not GRIB, shortened or damaged, or a
    field that is wanted is on a grid that is not known.
    """
    fields, others = [], set()
    known: dict[str, GribGrid] = {}
    with _readable(path), closing(_messages(path)) as messages:
        for message in messages:
            kind = message.kind
            if kind not in wanted:
                continue
            if message.is_plain or (kind in means and message.is_mean):
                fields.append(message.field(known))
            else:
                others.add(kind)
    return GribFields(tuple(fields), frozenset(others))


def grib_contents(path: Path) -> set[tuple[str, str, float]]:
    """List type of level, short name and level of all fields of a file.

    **Raises:** `DataError` as `read_grib`.
    """
    with _readable(path), closing(_messages(path)) as messages:
        return {(*message.kind, message.level) for message in messages}


class _Message:
    """One field in the hands of eccodes."""

    def __init__(self, path: Path, handle: int, eccodes: Any):
        self.path = path
        self._handle = handle
        self._eccodes = eccodes

    def get(self, key: str, kind: type | None = None) -> Any:
        """The value of a key, None where there is none."""
        ec = self._eccodes
        try:
            if ec.codes_is_missing(self._handle, key):
                return None
            return ec.codes_get(self._handle, key, kind)
        except ec.KeyValueNotFoundError:
            return None

    @property
    def kind(self) -> tuple[str, str]:
        level_type = self.get("typeOfLevel", str)
        if level_type == _PASCALS:
            level_type = PRESSURE
        return level_type or "unknown", self.get("shortName", str) or "unknown"

    @property
    def level(self) -> float:
        level = float(self.get("level", float) or 0.0)
        if self.kind[0] != PRESSURE:
            return level
        if self.get("edition") == 1:
            return level / 100 if self.get("typeOfLevel", str) == _PASCALS else level
        # eccodes cuts 92.5 hPa down to 92.
        scaled, factor = (
            self.get(f"scale{part}OfFirstFixedSurface", int)
            for part in ("dValue", "Factor")
        )
        if scaled is None or factor is None or abs(factor) > _DIGITS:
            return 0.0
        return round(scaled / 10.0**factor / 100, _DIGITS)

    @property
    def is_plain(self) -> bool:
        """Whether it is the field itself, at a time."""
        if self.get("stepType", str) != "instant":
            return False
        if self.get("edition") == 1:
            return self.get("dataType", str) not in _ERRORS_GRIB1
        if self.get("typeOfGeneratingProcess") in _NO_FIELDS:
            return False
        template = self.get("productDefinitionTemplateNumber")
        if template == _OF_ENSEMBLES:
            return self.get("derivedForecast") in _MEANS
        return template in _PLAIN_TEMPLATES

    @property
    def is_mean(self) -> bool:
        """Whether it is a mean over hours up to a time."""
        if self.get("stepType", str) != "avg" or not self._hours > 0:
            return False
        return self.get("typeOfGeneratingProcess") not in _NO_FIELDS

    @property
    def _hours(self) -> float:
        self._eccodes.codes_set(self._handle, "stepUnits", "s")
        start, end = (self.get(f"{end}Step", int) or 0 for end in ("start", "end"))
        return (end - start) / 3600

    def field(self, known: dict[str, GribGrid]) -> GribField:
        """The field; `known` grids, by the digest of their description, are kept."""
        digest = str(self.get("md5GridSection", str))
        if digest not in known:
            known[digest] = grid_of(self.path, self.get)
        grid = known[digest]
        level_type, name = self.kind
        return GribField(
            level_type=level_type,
            name=name,
            units=self.get("units", str),
            level=self.level,
            start=self._start(),
            valid_time=self._valid_time(),
            member=self._member(),
            grid=grid,
            winds_along_grid=bool(self.get("uvRelativeToGrid")),
            values=self._values(grid),
            mean_hours=self._hours if self.is_mean else 0.0,
        )

    def _member(self) -> int | None:
        number = self.get("number", int)
        if self.get("edition") == 1:
            # What is no ensemble may have the number 0, or none.
            return number or None
        template = self.get("productDefinitionTemplateNumber")
        return None if template in (0, _OF_ENSEMBLES) else number

    def _start(self) -> datetime:
        names = ("year", "month", "day", "hour", "minute", "second")
        parts = [self.get(name, int) or 0 for name in names]
        return self._time(*parts)

    def _valid_time(self) -> datetime:
        date, time = (
            self.get(f"validity{part}", int) or 0 for part in ("Date", "Time")
        )
        day = date // 10000, date // 100 % 100, date % 100
        return self._time(*day, time // 100, time % 100, self.get("second", int) or 0)

    def _time(self, *parts: int) -> datetime:
        try:
            return datetime(*parts, tzinfo=UTC)
        except ValueError as error:
            raise DataError(
                f"{self.path} has a field of a time that does not exist ({error}): "
                "download it again."
            ) from error

    def _values(self, grid: GribGrid) -> np.ndarray:
        ec = self._eccodes
        rows, columns = grid.shape
        try:
            require_values(ec.codes_get_message(self._handle), rows * columns)
        except (BrokenMessageError, IndexError) as error:
            raise DataError(
                f"{self.path} is damaged: the values of {self.kind[1]!r} at level "
                f"{self.level:g} do not fill their message, download it again."
            ) from error
        size = ec.codes_get_size(self._handle, "values")
        if size != rows * columns:
            raise DataError(
                f"{self.path} has {size} values on a grid of {rows} by {columns}: it "
                "is damaged, download it again."
            )
        ec.codes_set(self._handle, "missingValue", _MISSING)
        values = ec.codes_get_array(self._handle, "values", float)
        values = np.where(values == _MISSING, np.nan, values)
        return grid.scan.arranged(values.astype(np.float32), rows, columns)


def _messages(path: Path) -> Generator[_Message]:
    """All fields of a file, each only until the next is asked for."""
    # Not at the top: eccodes takes seconds to load, and brings a PROJ of its own that
    # crashes a pyproj imported after it.
    import eccodes

    left = list(message_offsets(path))
    with path.open("rb") as stream, _several_fields(eccodes, stream):
        while (handle := eccodes.codes_grib_new_from_file(stream)) is not None:
            try:
                offset = eccodes.codes_get(handle, "offset", int)
                if left and left[0] == offset:
                    left.pop(0)
                yield _Message(path, handle, eccodes)
            finally:
                eccodes.codes_release(handle)
        if left:
            raise DataError(
                f"{path} is damaged: its message at byte {left[0]} is not GRIB, "
                "download it again."
            )


@contextmanager
def _several_fields(eccodes: Any, stream: Any) -> Iterator[None]:
    """Let eccodes see every field of a message: winds often share one."""
    eccodes.codes_grib_multi_support_on()
    eccodes.codes_grib_multi_support_reset_file(stream)
    try:
        yield
    finally:
        eccodes.codes_grib_multi_support_off()


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    from eccodes import CodesInternalError

    try:
        yield
    except (CodesInternalError, UnicodeError, OverflowError, MemoryError) as error:
        raise DataError(
            f"{path} cannot be read as GRIB ({error}): it is damaged, download it "
            "again."
        ) from error
