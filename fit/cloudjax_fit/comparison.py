"""Radiances of one or more bands are compared, band by band."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from .air_column import AirColumn, standard_air
from .band_radiances import BandRadiances
from .common_pixels import common_pixels
from .cover_and_tops import CloudPair, clouds_of_both
from .histogram import Distances, distances
from .plain_data import plain
from .texture import FEWEST_ROWS, TexturePair, texture


@dataclass(frozen=True, eq=False)
class BandComparison:
    """One band of two sets of radiances; `distances` take `a` as the observed one.

    `textures` are those of `a` and of `b`, where both are images of one shape.
    """

    number: int
    name: str
    units: str
    a: BandRadiances
    b: BandRadiances
    distances: Distances
    textures: TexturePair | None = None


@dataclass(frozen=True, eq=False)
class Comparison:
    """A `Comparison` holds two sets of radiances, called `names`, in the bands that
    they share.

    `clouds` are None where these bands do not tell them from the ground; `facts` are
    shown on top.
    """

    title: str
    names: tuple[str, str]
    bands: Sequence[BandComparison]
    clouds: CloudPair | None = None
    facts: Mapping[str, str] = field(default_factory=dict)
    warnings: Sequence[str] = ()
    versions: Mapping[str, str] = field(default_factory=dict)


def compare(
    a: Mapping[int, BandRadiances],
    b: Mapping[int, BandRadiances],
    names: tuple[str, str],
    versions: Mapping[str, str] | None = None,
    *,
    air: AirColumn | None = None,
    facts: Mapping[str, str] | None = None,
    warnings: Sequence[str] = (),
) -> Comparison:
    """Measure how far the valid pixels of two sets of radiances are from each other.

    Bands that only one of them holds are left out, with a warning in the result, and so
    are the pixels that only one has of images of one area.

    `air` tells heights of cloud tops, by default that of the US standard atmosphere;
    `facts` and `warnings` are put before those that are found.

    Raises `cloudjax_data.DataError` when there is no band in common, when the two give
    a band as different quantities or in different units, or when one of them has no
    valid pixel in it.
    """
    shared = sorted(a.keys() & b.keys())
    _check_some_shared(a, b, names)
    for number in shared:
        _check_comparable(a[number], b[number], names)
    pairs = [_of_common_pixels(a[number], b[number], names) for number in shared]
    return Comparison(
        title=f"{names[0]} and {names[1]}: radiances compared",
        names=names,
        bands=[_compare_band(one, other) for one, other, _ in pairs],
        clouds=clouds_of_both(
            {one.number: one for one, *_ in pairs},
            {other.number: other for _, other, _ in pairs},
            air or standard_air(),
        ),
        facts=facts or {},
        warnings=[
            *warnings,
            *_left_out(a, b, names),
            *(said for *_, said in pairs if said),
        ],
        versions=versions or {},
    )


def comparison_json(comparison: Comparison) -> dict[str, Any]:
    """Return its numbers as plain data; None stands for what is not finite."""
    bands = {
        str(band.number): {"units": band.units}
        | plain(asdict(band.distances))
        | ({"texture": band.textures.numbers()} if band.textures else {})
        for band in comparison.bands
    }
    return {
        "a": comparison.names[0],
        "b": comparison.names[1],
        "warnings": list(comparison.warnings),
        "facts": dict(comparison.facts),
        "clouds": None if comparison.clouds is None else comparison.clouds.numbers(),
        "bands": bands,
        "versions": dict(comparison.versions),
    }


def _of_common_pixels(
    a: BandRadiances, b: BandRadiances, names: tuple[str, str]
) -> tuple[BandRadiances, BandRadiances, str]:
    """Both without the pixels that one lacks, and what to say of these."""
    first, second = a.image(), b.image()
    if first is None or second is None or a.grid is None or b.grid is None:
        return a, b, ""
    both = common_pixels(first, a.grid, second, b.grid)
    if both is None:
        return a, b, ""
    shared = replace(a, values=both[0]), replace(b, values=both[1])
    _check_comparable(*shared, names)
    # Of the area: pixels that were averaged are fewer and not lost.
    kept = [
        _known_share(one) / max(_known_share(whole), 1e-12)
        for one, whole in zip(shared, (a, b), strict=True)
    ]
    share = 1 - min(kept)
    said = f"{share:.1%} of the pixels of band {a.number} are in one of the two only"
    return *shared, f"{said}, and are left out." if share > 1e-9 else ""


def _known_share(band: BandRadiances) -> float:
    return band.pixels().size / band.values.size


def _compare_band(a: BandRadiances, b: BandRadiances) -> BandComparison:
    return BandComparison(
        number=a.number,
        name=f"C{a.number:02d}",
        units=a.units,
        a=a,
        b=b,
        distances=distances(a.pixels(), b.pixels()),
        textures=_textures(a.image(), b.image()),
    )


def _textures(a, b) -> TexturePair | None:
    if a is None or b is None or a.shape != b.shape or min(a.shape) < FEWEST_ROWS:
        return None
    known = np.isfinite(a) & np.isfinite(b)
    return TexturePair(texture(a, known), texture(b, known))


def _check_some_shared(
    a: Mapping[int, BandRadiances],
    b: Mapping[int, BandRadiances],
    names: tuple[str, str],
) -> None:
    from cloudjax_data import DataError

    if not a.keys() & b.keys():
        raise DataError(
            f"{names[0]} holds {_listed(a)} and {names[1]} holds {_listed(b)}: "
            "give two sets of radiances with a band in common."
        )


def _check_comparable(
    a: BandRadiances, b: BandRadiances, names: tuple[str, str]
) -> None:
    from cloudjax_data import DataError

    if a.quantity is not b.quantity:
        raise DataError(
            f"{names[0]} gives {a.quantity.words} in band {a.number} and {names[1]} "
            f"{b.quantity.words}: render both with the same --quantity."
        )
    if a.units.split() != b.units.split():
        raise DataError(
            f"{names[0]} gives band {a.number} in '{a.units}' and {names[1]} in "
            f"'{b.units}': convert one to the units of the other."
        )
    for side, name in zip((a, b), names, strict=True):
        if not np.isfinite(side.values).any():
            raise DataError(
                f"{name} has no valid pixel in band {side.number}: "
                "leave the band out or give another file."
            )


def _left_out(
    a: Mapping[int, BandRadiances],
    b: Mapping[int, BandRadiances],
    names: tuple[str, str],
) -> list[str]:
    alone = [(names[0], a.keys() - b.keys()), (names[1], b.keys() - a.keys())]
    return [
        f"Left out, because only {name} holds them: {_listed(numbers)}."
        for name, numbers in alone
        if numbers
    ]


def _listed(bands: Iterable[int]) -> str:
    numbers = ", ".join(map(str, sorted(bands)))
    return f"bands {numbers}" if numbers else "no bands"
