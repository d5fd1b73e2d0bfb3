"""What a netCDF file holds, in memory, to be changed and written again."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np


@dataclass
class Held:
    """A variable as it is stored, not decoded.

    **Fields:** `options`: of `createVariable`, such as chunks and byte order.
    """

    dimensions: tuple[str, ...]
    stored: Any
    attributes: dict[str, Any]
    options: dict[str, Any] = field(default_factory=dict)


@dataclass
class Content:
    """All of a file: sizes of dimensions, global attributes, variables."""

    dimensions: dict[str, int]
    attributes: dict[str, Any]
    variables: dict[str, Held]

    @classmethod
    def of(cls, path: Path) -> "Content":
        with netCDF4.Dataset(path) as file:
            file.set_auto_maskandscale(False)
            return cls(
                {name: d.size for name, d in file.dimensions.items()},
                {name: file.getncattr(name) for name in file.ncattrs()},
                {
                    name: Held(
                        v.dimensions,
                        np.asarray(v[...]),
                        {key: v.getncattr(key) for key in v.ncattrs()},
                    )
                    for name, v in file.variables.items()
                },
            )

    def write(self, path: Path) -> Path:
        with netCDF4.Dataset(path, "w", format="NETCDF4") as file:
            for name, value in self.attributes.items():
                file.setncattr(name, value)
            for name, size in self.dimensions.items():
                file.createDimension(name, size)
            for name, held in self.variables.items():
                _write(file, name, held)
        return path


def _write(file: netCDF4.Dataset, name: str, held: Held) -> None:
    attributes = dict(held.attributes)
    stored = held.stored
    kind: Any = str if isinstance(stored, str) else np.asarray(stored).dtype
    fill = attributes.pop("_FillValue", None)
    options = dict(held.options)
    if kind is not str and kind.byteorder == ">":
        options["endian"] = "big"
    new = file.createVariable(name, kind, held.dimensions, fill_value=fill, **options)
    if kind is not str:
        new.set_auto_maskandscale(False)
    for key, value in attributes.items():
        new.setncattr(key, value)
    if kind is str:
        new[...] = np.full([d or 1 for d in new.shape], stored, object)
    elif new.size:
        new[...] = stored


def changed(path: Path, change: Callable[[Content], Any]) -> Path:
    """The same file, with its content changed."""
    content = Content.of(path)
    change(content)
    return content.write(path)
