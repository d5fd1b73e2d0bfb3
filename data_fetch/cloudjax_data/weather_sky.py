"""Fields of a file that tell of its sky: cloud covers, the tropopause, instability.

None is required, and what a file has is used. A forecast gives most covers as means
over the hours before its time: such a mean serves where there is no value of the time
itself.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32

from .grib import GribField


@dataclass(frozen=True)
class SkyField:
    """A `SkyField` says where a variable is found.

    **Fields:**

    - `kinds`: types of level and short names, the first that is there serves.
    - `units`: as eccodes spells them.
    - `possible`: values; a field with others is left out.
    - `index`: parameter and level in the index beside a GFS file.
    """

    kinds: tuple[tuple[str, str], ...]
    units: str
    possible: tuple[float, float]
    index: tuple[str, str]


def _cover(level_type: str, index: tuple[str, str], *names: str) -> SkyField:
    kinds = tuple((level_type, name) for name in (*names, "tcc"))
    return SkyField(kinds, "%", (-1.0, 101.0), index)


# name in the cube: where it is
SKY = {
    "cover_low": _cover("lowCloudLayer", ("LCDC", "low cloud layer"), "lcc"),
    "cover_middle": _cover("middleCloudLayer", ("MCDC", "middle cloud layer"), "mcc"),
    "cover_high": _cover("highCloudLayer", ("HCDC", "high cloud layer"), "hcc"),
    "cover_total": SkyField(
        (("atmosphere", "tcc"), ("atmosphereSingleLayer", "tcc")),
        "%",
        (-1.0, 101.0),
        ("TCDC", "entire atmosphere"),
    ),
    "cover_boundary": _cover(
        "boundaryLayerCloudLayer", ("TCDC", "boundary layer cloud layer")
    ),
    "cover_convective": _cover(
        "convectiveCloudLayer", ("TCDC", "convective cloud layer")
    ),
    "convective_top_pa": SkyField(
        (("convectiveCloudTop", "pres"),),
        "Pa",
        (0.0, 120e3),
        ("PRES", "convective cloud top level"),
    ),
    "tropopause_gpm": SkyField(
        (("tropopause", "gh"),), "gpm", (1e3, 30e3), ("HGT", "tropopause")
    ),
    "cape": SkyField(
        (("surface", "cape"),), "J kg**-1", (-1.0, 2e4), ("CAPE", "surface")
    ),
}
# Of which means over time serve.
MEANS = frozenset(kind for field in SKY.values() for kind in field.kinds)


@dataclass(frozen=True, eq=False)
class Sky:
    """A `Sky` is what of `SKY` a file has.

    **Fields:** `values` and `units` by name; `means`: which are means over time.
    """

    values: Mapping[str, Float32[np.ndarray, "rows columns"]]
    units: Mapping[str, str]
    means: frozenset[str]


def sky_of(fields: Sequence[GribField], first: GribField) -> Sky:
    """Choose among the fields of a file.

    What is of another grid, time or member than `first`, in other units or impossible
    is left out, for the weather does without.
    """
    chosen = {name: _chosen(wanted, fields, first) for name, wanted in SKY.items()}
    found = {name: field for name, field in chosen.items() if field is not None}
    return Sky(
        {name: field.values for name, field in found.items()},
        {name: field.units for name, field in found.items()},
        frozenset(name for name, field in found.items() if field.is_mean),
    )


def _chosen(
    wanted: SkyField, fields: Sequence[GribField], first: GribField
) -> GribField | None:
    """A value of the time itself before a mean, and of these the shortest."""
    fitting = [
        field
        for kind in wanted.kinds
        for field in fields
        if (field.level_type, field.name) == kind and _fits(wanted, field, first)
    ]
    return min(
        fitting, key=lambda field: (field.is_mean, field.mean_hours), default=None
    )


def _fits(wanted: SkyField, field: GribField, first: GribField) -> bool:
    low, high = wanted.possible
    known = field.values[np.isfinite(field.values)]
    return bool(
        (field.start, field.valid_time, field.member)
        == (first.start, first.valid_time, first.member)
        and field.units == wanted.units
        and field.grid.is_same(first.grid)
        and known.size
        and known.min() >= low
        and known.max() <= high
    )
