"""What may befall a GRIB file, and what must come of it."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from .grib_bases import Message, messages, sections


Change = Callable[[list[bytes], np.random.Generator], bytes]

# What must come of a mutation:
# the same weather, but for rounding;
SAME = "same"
# the same within what another packing rounds;
REPACKED = "repacked"
# the same where there is something, and nothing in between;
HOLES = "holes"
# the same on the levels that are left, and a word on those that are not;
FEWER = "fewer"
# a sentence;
REFUSED = "refused"
# a sentence or the same weather, on fewer levels at most.
FAIR = "fair"

_CUT, _FLIPS = 3, 12
_MIDDLE = 9


@dataclass(frozen=True)
class Mutation:
    """One change of a file, `expect` one of those above, and another `file_name`."""

    name: str
    change: Change
    expect: str
    file_name: str = "weather.grib"


def mutations(base: str, content: bytes) -> list[Mutation]:
    """All mutations of a base."""
    parts = messages(content)
    first = Message(parts[0])
    return [
        *_of_files(parts),
        *_cuts(parts),
        *_names(),
        *_scans(first),
        *_of_grids(first),
        *_of_fields(first),
        *_of_values(base),
        *_flips(parts),
    ]


def _joined(change: Callable[[list[bytes], np.random.Generator], list[bytes]]):
    return lambda parts, rng: b"".join(change(parts, rng))


def _shuffled(parts, rng):
    return [parts[i] for i in rng.permutation(len(parts))]


def _without(number: int):
    return _joined(lambda parts, rng: parts[:number] + parts[number + 1 :])


def _of_files(parts: list[bytes]) -> Iterator[Mutation]:
    heading = b"\r\r\n018 \r\r\nYUQA85 KWBC 271800\r\r\n"
    yield Mutation("twice", _joined(lambda parts, rng: parts * 2), SAME)
    yield Mutation("shuffled", _joined(_shuffled), SAME)
    yield Mutation("backwards", _joined(lambda parts, rng: parts[::-1]), SAME)
    for name, padding in (("newline", b"\n"), ("zeros", bytes(999)), ("crlf", b"\r\n")):
        yield Mutation(f"{name} after", lambda p, r, b=padding: b"".join(p) + b, SAME)
        yield Mutation(f"{name} between", lambda p, r, b=padding: b.join(p), SAME)
    yield Mutation("headings", lambda p, r: heading + heading.join(p), SAME)
    for rest in (b"G", b"GRIB", b"7777", b"<html></html>", b"GRIB\0\0\0\2" + bytes(8)):
        yield Mutation(f"{rest} after", lambda p, r, b=rest: b"".join(p) + b, REFUSED)
    for number in (0, 5, 11, len(parts) - 1):
        yield Mutation(f"without message {number}", _without(number), FAIR)
    yield Mutation("nothing", lambda parts, rng: b"", REFUSED)
    yield Mutation("one message", lambda parts, rng: parts[0], REFUSED)
    yield Mutation(
        "text", lambda parts, rng: b"1:0:d=2019102718:UGRD:850 mb\n", REFUSED
    )
    for byte in (*range(8), 15):
        yield Mutation(f"head {byte}", _flipped(_MIDDLE, byte, 2), FAIR)
    yield Mutation("end", _flipped(_MIDDLE, -1, 1), REFUSED)


def _cuts(parts: list[bytes]) -> Iterator[Mutation]:
    """Ends at each section of some messages, and within it."""
    for number in (0, _MIDDLE, len(parts) - 1):
        before = sum(map(len, parts[:number]))
        for section, start, length in sections(parts[number]):
            for end in (start, start + length // 2):
                yield Mutation(
                    f"cut in section {section} of message {number} at {end}",
                    lambda p, r, size=before + end: b"".join(p)[:size],
                    REFUSED,
                )
        yield Mutation(
            f"cut before message {number}",
            lambda p, r, size=before: b"".join(p)[:size],
            FAIR if number else REFUSED,
        )


def _names() -> Iterator[Mutation]:
    for name in ("._gfs", "gfs.idx", "a b.grb", "погода.nc", "x.grib2.gz", ".hidden"):
        yield Mutation(f"called {name}", lambda p, r: b"".join(p), SAME, name)


def _each(change: Callable[[Message], Message]) -> Change:
    """A change of all fields on pressure levels."""

    def changed(parts, rng):
        return b"".join(change(Message(part)).content for part in parts)

    return changed


def _one(change: Callable[[Message], Message], number: int = _MIDDLE) -> Change:
    """A change of one field."""

    def changed(parts, rng):
        one = change(Message(parts[number])).content
        return b"".join([*parts[:number], one, *parts[number + 1 :]])

    return changed


def _keys(**keys: Any) -> Callable[[Message], Message]:
    return lambda message: message.set(**keys)


def _scans(first: Message) -> Iterator[Mutation]:
    flags = range(0, 256, 32 if first.get("edition") == 1 else 16)
    for scan in flags:
        yield Mutation(f"scan {scan:08b}", _each(lambda m, s=scan: m.scanned(s)), SAME)
    yield Mutation("one scan", _one(lambda m: m.scanned(0xE0)), SAME)


def _of_grids(first: Message) -> Iterator[Mutation]:
    plain = first.get("gridType") == "regular_ll"
    edition = first.get("edition")
    columns, rows = first.get("Ni"), first.get("Nj")
    for i, j in (
        (0, rows),
        (1, rows),
        (columns, 1),
        (columns + 1, rows),
        (columns, rows - 1),
        (rows, columns),
        (columns * rows, 1),
    ):
        # A Lambert map has no last point to tell rows from columns.
        if (i, j) != (columns, rows) and (plain or (i, j) != (rows, columns)):
            yield Mutation(f"{i} by {j}", _each(_keys(Ni=i, Nj=j)), REFUSED)
    yield Mutation("one of other size", _one(_keys(Ni=columns + 1)), REFUSED)
    yield Mutation("flag 0x08", _each(_keys(scanningMode=8)), REFUSED)
    kinds = ("rotated_ll", "regular_gg", "polar_stereographic", "mercator")
    for kind in kinds if edition == 2 else kinds[:2]:
        yield Mutation(kind, _each(_keys(gridType=kind)), REFUSED)
    if not plain:
        for key, value in (
            ("LoVInDegrees", 200.0),
            ("DxInMetres", 1),
            ("Latin1", 0),
            ("latitudeOfFirstGridPointInDegrees", 89.0),
        ):
            yield Mutation(f"one {key}", _one(_keys(**{key: value}), 0), REFUSED)
        # The first field may be no wind.
        yield Mutation("one wind flag", _one(_keys(uvRelativeToGrid=0), 0), FAIR)
        yield Mutation("ellipsoid", _each(_keys(shapeOfTheEarth=5)), REFUSED)
        yield Mutation("no steps", _each(_keys(DxInMetres=0)), REFUSED)
        yield Mutation("no cone", _each(_keys(Latin1=0, Latin2=0)), REFUSED)
        return
    south = first.get("latitudeOfLastGridPointInDegrees")
    west = first.get("longitudeOfFirstGridPointInDegrees")
    step = first.get("iDirectionIncrementInDegrees")
    north_to_south = first.get("jScansPositively") == 0
    for name, keys in {
        "west for east": {"iScansNegatively": 1},
        "upside down": {"jScansPositively": int(north_to_south)},
        "first longitude": {"longitudeOfFirstGridPointInDegrees": west + step},
        "last longitude": {"longitudeOfLastGridPointInDegrees": west + 1.5 * step},
        "last latitude": {"latitudeOfLastGridPointInDegrees": south + 1.0},
        "beyond the pole": {"latitudeOfFirstGridPointInDegrees": 95.0},
        "half a step": {"iDirectionIncrementInDegrees": step / 2},
        "twice a step down": {"jDirectionIncrementInDegrees": 2 * step},
    }.items():
        yield Mutation(name, _each(_keys(**keys)), REFUSED)
    if edition == 2:
        for shape in (0, 2, 5, 8):
            yield Mutation(f"Earth {shape}", _each(_keys(shapeOfTheEarth=shape)), SAME)
    given = {"resolutionAndComponentFlags": 0}
    yield Mutation("no increments", _each(_keys(**given)), SAME)
    yield Mutation("one without increments", _one(_keys(**given)), SAME)
    yield Mutation("winds of the grid", _one(_keys(uvRelativeToGrid=1)), SAME)


def _of_fields(first: Message) -> Iterator[Mutation]:
    second = first.get("edition") == 2
    yield Mutation("level of another", _one(_to_level(850)), FAIR)
    yield Mutation("new level", _one(_to_level(777)), FEWER)
    yield Mutation("no level", _one(_to_level(0)), FAIR)
    yield Mutation("surfaces", _each(_keys(typeOfLevel="surface")), REFUSED)
    yield Mutation("hybrid", _each(_keys(typeOfLevel="hybrid")), REFUSED)
    yield Mutation("one hybrid", _one(_keys(typeOfLevel="hybrid")), FEWER)
    for name in ("pt", "q", "vo", "z"):
        yield Mutation(f"one {name}", _one(_keys(shortName=name)), FEWER)
        yield Mutation(f"all {name}", _each(_keys(shortName=name)), REFUSED)
    for number in (0, _MIDDLE, 13):
        later = _keys(dataTime=600)
        yield Mutation(f"another time of {number}", _one(later, number), REFUSED)
        step = _keys(**({"forecastTime": 9} if second else {"P1": 9}))
        yield Mutation(f"another step of {number}", _one(step, number), REFUSED)
    yield Mutation("two times", _followed(_keys(dataTime=600)), REFUSED)
    yield Mutation("two days", _followed(_keys(dataDate=20190101)), REFUSED)
    if not second:
        yield Mutation("average", _one(_keys(timeRangeIndicator=3, P2=6)), FEWER)
        yield Mutation("month 13", _each(_keys(month=13)), REFUSED)
        return
    yield Mutation("month 13", _each(_keys(month=13)), REFUSED)
    yield Mutation("hour 25", _each(_keys(hour=25)), REFUSED)
    member = _keys(productDefinitionTemplateNumber=1, perturbationNumber=2)
    spread = _keys(productDefinitionTemplateNumber=2, derivedForecast=4)
    yield Mutation("a member", _one(member), REFUSED)
    yield Mutation("two members", _followed(member), REFUSED)
    yield Mutation("a spread", _one(spread), FEWER)
    yield Mutation("spreads too", _followed(spread), SAME)
    yield Mutation("spreads only", _each(spread), REFUSED)
    yield Mutation("an error", _one(_keys(typeOfGeneratingProcess=7)), FEWER)
    average = _keys(productDefinitionTemplateNumber=8)
    yield Mutation("an average", _one(average), FEWER)
    yield Mutation("averages only", _each(average), REFUSED)
    for centre in (7, 98, 34, 78):
        yield Mutation(f"centre {centre}", _each(_keys(centre=centre)), FAIR)


def _to_level(level: int) -> Callable[[Message], Message]:
    # As a level in hPa, whatever the field was on.
    return _keys(typeOfLevel="isobaricInhPa", level=level)


def _followed(change: Callable[[Message], Message]) -> Change:
    """The file, and all of it again, changed."""
    return lambda parts, rng: b"".join(parts) + _each(change)(parts, rng)


def _of_values(base: str) -> Iterator[Mutation]:
    for value in (9.999e20, -1e30, 1e5):
        yield Mutation(f"{value:g}", _one(lambda m, v=value: _point(m, v)), REFUSED)
    yield Mutation(
        "another value", _followed_by_one(lambda m: m.put(m.values + 1)), REFUSED
    )
    yield Mutation("one masked", _one(_masked(1.0)), FEWER)
    yield Mutation("half masked", _one(_masked(0.5)), HOLES)
    yield Mutation("all masked", _each(_masked(1.0)), REFUSED)
    packings = ["grid_ieee"]
    if not base.endswith("grib1"):
        packings += ["grid_ccsds", "grid_complex", "grid_complex_spatial_differencing"]
    for packing in packings:
        changed = _each(lambda m, p=packing: _repacked(m, p))
        yield Mutation(packing, changed, REPACKED)
    yield Mutation("more bits", _each(_with_more_bits), REPACKED)


def _repacked(message: Message, packing: str) -> Message:
    values = message.values
    return message.set(packingType=packing, bitsPerValue=24).put(values)


def _with_more_bits(message: Message) -> Message:
    values = message.values
    return message.set(bitsPerValue=28).put(values)


def _point(message: Message, value: float) -> Message:
    values = message.values
    values[len(values) // 2] = value
    return message.set(bitmapPresent=0, packingType="grid_ieee").put(values)


def _masked(share: float) -> Callable[[Message], Message]:
    def masked(message: Message) -> Message:
        values = message.values
        values[: round(share * values.size)] = 1e20
        return message.set(bitmapPresent=1, missingValue=1e20).put(values)

    return masked


def _followed_by_one(change: Callable[[Message], Message]) -> Change:
    return lambda parts, rng: b"".join(
        [*parts, change(Message(parts[_MIDDLE])).content]
    )


def _flips(parts: list[bytes]) -> Iterator[Mutation]:
    """A bit of a head of one message, at random, but of nothing that is packed."""
    spans = [
        (number, start, length)
        for number, start, length in sections(parts[_MIDDLE])
        if number in ((1, 3, 4) if parts[0][7] == 2 else (1, 2))
    ]
    for number, start, length in spans:
        for i in range(_FLIPS):
            yield Mutation(
                f"bit {i} of section {number}",
                _random_flip(start, length, number),
                FAIR,
            )


def _random_flip(start: int, length: int, section: int) -> Change:
    def flipped(parts, rng):
        byte = int(rng.integers(length))
        # The decimal scale of edition 1 is of the packing.
        if parts[0][7] == 1 and section == 1 and byte in (26, 27):
            byte = 4
        return _flipped(_MIDDLE, start + byte, 1 << int(rng.integers(8)))(parts, rng)

    return flipped


def _flipped(number: int, byte: int, bit: int) -> Change:
    def flipped(parts, rng):
        one = bytearray(parts[number])
        one[byte] ^= bit
        return b"".join([*parts[:number], bytes(one), *parts[number + 1 :]])

    return flipped
