"""Types of cloud: where one stands, its shape, its size, and of what it is."""

import importlib.resources
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from cloudjax.toml_table import (
    NUMBER,
    POSITIVE,
    TEXT,
    Kind,
    TomlError,
    checked,
    least,
    one_of,
    parse_toml,
)

from .shapes import SHAPES


_SHARE = Kind(
    "a number from 0 to 1",
    lambda value: NUMBER.holds(value) and 0 <= value <= 1,
)
_NEEDED: Mapping[str, Kind] = {
    "base_m": NUMBER,
    "top_m": NUMBER,
    "width_m": POSITIVE,
    "shape": one_of(SHAPES),
    "kernels": least(1),
    "kernel_m": POSITIVE,
    "optical_depth": POSITIVE,
}
_OTHER: Mapping[str, Kind] = {
    "vary": _SHARE,
    "stretch": POSITIVE,
    "sections": least(1),
    "section_share": _SHARE,
    "ice_share": _SHARE,
    "source": TEXT,
}
TYPE_KEYS: Mapping[str, Kind] = {**_NEEDED, **_OTHER}


@dataclass(frozen=True)
class CloudType:
    """A `CloudType` is what all clouds of a type have in common.

    **Fields:**

    - `base_m`, `top_m`: above the ground.
    - `width_m`: of one cloud; `vary`: by how much of it, and of the height, clouds are
      larger or smaller; `stretch`: how much longer than wide.
    - `shape`: one of `shapes.SHAPES`, of the cloud and of its sections.
    - `sections`: parts of a cloud; `section_share`: their size, of the cloud's.
    - `kernels`: of each section; `kernel_m`: their radius.
    - `optical_depth`: mean over the ground below the shape.
    - `ice_share`: of the optical depth; the rest is water.
    - `source`: of the numbers.

    **Raises:** `ValueError` for a top that is no higher than the base, and for cloud
    below the ground.
    """

    base_m: float
    top_m: float
    width_m: float
    shape: str
    kernels: int
    kernel_m: float
    optical_depth: float
    vary: float = 0.0
    stretch: float = 1.0
    sections: int = 1
    section_share: float = 1.0
    ice_share: float = 0.0
    source: str = ""

    def __post_init__(self):
        if not 0 <= self.base_m < self.top_m:
            raise ValueError(
                f"base_m = {self.base_m:g} and top_m = {self.top_m:g} are no cloud: "
                "make the base 0 or more, and the top higher."
            )


def built_in_types() -> Mapping[str, Mapping[str, Any]]:
    """Return the tables of the types that come with cloudjax, by name."""
    name = "cloud_types.toml"
    file = importlib.resources.files("cloudjax_scenes.by_type").joinpath(name)
    return parse_toml(file.read_text(encoding="utf-8"), name)


def cloud_type(table: Mapping[str, Any], where: str) -> CloudType:
    """Make a type of a table; `where` it is, for messages.

    **Raises:** `TomlError` for keys that are unknown or missing, or wrong values.
    """
    given = checked(table, _NEEDED, _OTHER, where)
    values: dict[str, Any] = {
        key: float(value) if _OTHER.get(key) is _SHARE else value
        for key, value in given.items()
    }
    try:
        return CloudType(**values)
    except ValueError as error:
        raise TomlError(f"{where}: {error}") from error
