"""Whole GRIB files that mutations start from: generated, and parts of real ones."""

import functools as ft
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from tests.generated_grib import in_order, write_grib, write_lambert_grib


HEIGHT = {1000: 110.0, 850: 1500.0, 500: 5600.0, 300: 9200.0}
RANGES = {"u": 20, "v": 20, "w": 1, "r": 90, "t": 280, "gh": 40}
GLOBE = np.arange(90.0, -91.0, -30.0), np.arange(0.0, 360.0, 30.0)
DATE_LINE = np.arange(50.0, 39.0, -2.5), 150.0 + 2.5 * np.arange(20)
GENERATED = ("globe", "globe-grib1", "date-line-grib1", "lambert")
REAL = {
    "gfs": "gfs_2p5deg_20110115T12/gfs.t12z.pgrbf120.2p5deg.grib2",
    "nam": "nam_211_20180917T00/nam.t00z.awp21100.tm00.grib2",
}


def generated(name: str, folder: Path) -> bytes:
    """One of `GENERATED`: four levels of six variables, orography and skin."""
    edition = 1 if name.endswith("grib1") else 2
    latitude, longitude = DATE_LINE if name.startswith("date") else GLOBE
    shape = (6, 8) if name == "lambert" else (latitude.size, longitude.size)
    rng = np.random.default_rng(1)
    fields = {
        (variable, level): rng.uniform(0.5, 1.0, shape) * size
        + (height if variable == "gh" else 0.0)
        for level, height in HEIGHT.items()
        for variable, size in RANGES.items()
    }
    fields |= {("orog", 0): np.full(shape, 50.0), ("t", 0): np.full(shape, 290.0)}
    path = folder / "base.grib"
    if name == "lambert":
        return write_lambert_grib(path, fields).read_bytes()
    if edition == 1:
        longitude = (longitude + 180) % 360 - 180
    return write_grib(
        path, fields, latitude_deg=latitude, longitude_deg=longitude, edition=edition
    ).read_bytes()


@ft.cache
def real(path: Path) -> bytes:
    """Four levels of a real file, each field a message of its own."""
    wanted = {("isobaricInhPa", n, level) for n in RANGES for level in HEIGHT}
    import eccodes

    parts = []
    with path.open("rb") as stream:
        eccodes.codes_grib_multi_support_on()
        eccodes.codes_grib_multi_support_reset_file(stream)
        while (message := eccodes.codes_grib_new_from_file(stream)) is not None:
            key = tuple(
                eccodes.codes_get(message, k)
                for k in ("typeOfLevel", "shortName", "level")
            )
            if key in wanted:
                parts.append(eccodes.codes_get_message(message))
            eccodes.codes_release(message)
        eccodes.codes_grib_multi_support_off()
    return b"".join(parts)


def messages(content: bytes) -> list[bytes]:
    """Cut a whole file, by the lengths that its messages give."""
    parts = []
    while content:
        size = slice(8, 16) if content[7] == 2 else slice(4, 7)
        length = int.from_bytes(content[size])
        parts.append(content[:length])
        content = content[length:]
    return parts


def sections(message: bytes) -> Iterator[tuple[int, int, int]]:
    """Number, first byte and length of each section of a message but its ends."""
    if message[7] == 2:
        at = 16
        while message[at : at + 4] != b"7777":
            length = int.from_bytes(message[at : at + 4])
            yield message[at + 4], at, length
            at += length
        return
    at, flags = 8, message[15]
    optional = [number for number, flag in ((2, 0x80), (3, 0x40)) if flags & flag]
    for number in (1, *optional, 4):
        length = int.from_bytes(message[at : at + 3])
        yield number, at, length
        at += length


class Message:
    """A message in the hands of eccodes, to be changed."""

    def __init__(self, content: bytes):
        import eccodes

        self._eccodes = eccodes
        self._handle = eccodes.codes_new_from_message(content)

    def __del__(self):
        self._eccodes.codes_release(self._handle)

    def get(self, key: str, kind: Any = None) -> Any:
        return self._eccodes.codes_get(self._handle, key, kind)

    def set(self, **keys: Any) -> "Message":
        for key, value in keys.items():
            if value is None:
                self._eccodes.codes_set_missing(self._handle, key)
            else:
                self._eccodes.codes_set(self._handle, key, value)
        return self

    @property
    def values(self) -> np.ndarray:
        return self._eccodes.codes_get_values(self._handle)

    def put(self, values: np.ndarray) -> "Message":
        self._eccodes.codes_set_values(self._handle, np.asarray(values, float).ravel())
        return self

    @property
    def content(self) -> bytes:
        return self._eccodes.codes_get_message(self._handle)

    @property
    def field(self) -> tuple[str, int]:
        return self.get("shortName"), self.get("level")

    def scanned(self, scan: int) -> "Message":
        """The same field in another order of points, unpacked.

        It must be scanned from the west, row by row.
        """
        rows, columns = self.get("Nj"), self.get("Ni")
        field = self.values.reshape(rows, columns)
        southward = not self.get("jScansPositively")
        latitude, longitude = (
            np.reshape(
                np.asarray(self._eccodes.codes_get_array(self._handle, axis)),
                (rows, columns),
            )
            for axis in ("latitudes", "longitudes")
        )
        from_north = slice(None) if southward else slice(None, None, -1)
        row, column = (-1 if scan & 0x40 else 0), (-1 if scan & 0x80 else 0)
        ends = {}
        for end, at in (("First", (row, column)), ("Last", (-1 - row, -1 - column))):
            if end == "Last" and self.get("gridType") != "regular_ll":
                continue
            ends[f"latitudeOf{end}GridPointInDegrees"] = latitude[from_north][at]
            ends[f"longitudeOf{end}GridPointInDegrees"] = longitude[from_north][at]
        self.set(packingType="grid_ieee", scanningMode=scan, **ends)
        return self.put(in_order(field[from_north], scan))
