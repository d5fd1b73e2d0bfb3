"""Radiances of one or more bands, read from whatever holds them, and compared."""

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float, Num

from cloudjax import FixedGrid
from cloudjax_scenes.quantity import RADIANCE, Quantity, parse_variable

from .common_pixels import common_pixels
from .histogram import Distances, distances
from .texture import FEWEST_ROWS, TexturePair, texture


if TYPE_CHECKING:
    import xarray as xr

    from cloudjax_data import AbiBand


_MULTIBAND = re.compile(r"CMI_C(\d\d)$")


@dataclass(frozen=True, eq=False)
class BandRadiances:
    """Radiances of one ABI band, in `units`, NaN where there is none.

    Or another `quantity`, where a file has no radiances. `values` are an image
    `[y, x]`, or pixels without places `[n]`. `grid` is that of an image, where it is
    known.
    """

    number: int
    units: str
    values: Num[np.ndarray, "_ _"] | Num[np.ndarray, " _"]
    quantity: Quantity = RADIANCE
    grid: FixedGrid | None = None

    def pixels(self) -> Float[np.ndarray, " n"]:
        """The finite radiances, without their places, in float64."""
        values = np.asarray(self.values, np.float64).ravel()
        return values[np.isfinite(values)]

    def image(self) -> Num[np.ndarray, "_ _"] | None:
        """The image, or None for pixels without places."""
        return self.values if self.values.ndim == 2 else None


def read_radiances(path: str | PathLike[str]) -> dict[int, BandRadiances]:
    """Reads every band that a path holds, keyed by band number.

    `path` is a scene folder, one ABI file, or a netCDF file that cloudjax wrote: one
    variable `radiance_C13` per band, with the attributes `units` and `abi_band`. Where
    a band has none, `reflectance_C01` or `brightness_temperature_C13` is read.

    Raises `cloudjax_data.DataError`, one sentence that names the file and the remedy,
    for anything else.
    """
    from cloudjax_data import DataError

    path = Path(path)
    if path.is_dir():
        return _read_folder(path)
    if not path.exists():
        raise DataError(f"{path} does not exist: give a scene folder or a netCDF file.")
    return _read_file(path)


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
    """Two sets of radiances, called `names`, in the bands that they share."""

    title: str
    names: tuple[str, str]
    bands: Sequence[BandComparison]
    warnings: Sequence[str] = ()
    versions: Mapping[str, str] = field(default_factory=dict)


def compare(
    a: Mapping[int, BandRadiances],
    b: Mapping[int, BandRadiances],
    names: tuple[str, str],
    versions: Mapping[str, str] | None = None,
) -> Comparison:
    """Measures how far the valid pixels of two sets of radiances are from each other.

    Bands that only one of them holds are left out, with a warning in the result, and so
    are the pixels that only one has of images of one area.

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
        warnings=_left_out(a, b, names) + [said for *_, said in pairs if said],
        versions=versions or {},
    )


def comparison_json(comparison: Comparison) -> dict[str, Any]:
    """The numbers of a comparison as plain data; None stands for what is not finite."""
    bands = {
        str(band.number): {"units": band.units}
        | {
            key: number if math.isfinite(number) else None
            for key, number in asdict(band.distances).items()
        }
        | ({"texture": band.textures.numbers()} if band.textures else {})
        for band in comparison.bands
    }
    return {
        "a": comparison.names[0],
        "b": comparison.names[1],
        "warnings": list(comparison.warnings),
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
    kept = [
        one.pixels().size / max(whole.pixels().size, 1)
        for one, whole in zip(shared, (a, b), strict=True)
    ]
    share = 1 - min(kept)
    said = f"{share:.1%} of the pixels of band {a.number} are in one of the two only"
    return *shared, f"{said}, and are left out." if share > 0 else ""


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


def _read_folder(path: Path) -> dict[int, BandRadiances]:
    from cloudjax_data import open_folder

    return _of_abi(open_folder(path).read().bands.values())


def _of_abi(bands: "Iterable[AbiBand]") -> dict[int, BandRadiances]:
    return {
        b.number: BandRadiances(b.number, b.units, b.radiance, grid=b.grid)
        for b in bands
    }


def _read_file(path: Path) -> dict[int, BandRadiances]:
    from cloudjax_data import DataError, read_band

    with _open_dataset(path) as dataset:
        names = {str(name) for name in dataset.data_vars}
        if any(map(parse_variable, names)):
            return _simulated_bands(dataset, path)
    if {"Rad", "CMI"} & names:
        return _of_abi([read_band(path)])
    numbers = sorted(int(m[1]) for name in names if (m := _MULTIBAND.match(name)))
    if not numbers:
        raise DataError(
            f"{path} holds neither ABI radiances nor those of a cloudjax run: "
            "give a scene folder, an ABI L1b or CMI file, or a simulated.nc."
        )
    return _of_abi(read_band(path, band=number) for number in numbers)


@contextmanager
def _open_dataset(path: Path) -> "Iterator[xr.Dataset]":
    import xarray as xr

    from cloudjax_data import DataError
    from cloudjax_data.plain_path import plain_path

    try:
        # Not decoded yet: the packed integers of ABI files are for their own reader.
        with (
            plain_path(path) as plain,
            xr.open_dataset(plain, engine="netcdf4", decode_cf=False) as dataset,
        ):
            yield dataset
    # The netCDF library raises RuntimeError when the header is whole and the data not.
    except (OSError, RuntimeError) as error:
        raise DataError(
            f"{path} cannot be read as netCDF: it is incomplete or of another kind; "
            "fetch or write it again."
        ) from error


def _simulated_bands(dataset: "xr.Dataset", path: Path) -> dict[int, BandRadiances]:
    import xarray as xr

    held = {name: parse_variable(str(name)) for name in dataset.data_vars}
    known = {name: found for name, found in held.items() if found is not None}
    grid = _grid_of(dataset)
    # Radiances last: they replace what else there is of a band.
    names = sorted(known, key=lambda name: known[name][0] is RADIANCE)
    bands = {}
    decoded = xr.decode_cf(dataset[names], decode_times=False)
    for name in names:
        quantity, number = known[name]
        variable = decoded[name]
        _check_attributes(variable, number, path)
        units = str(variable.attrs["units"])
        values = variable.to_numpy()
        fits = grid is not None and grid.shape == values.shape
        bands[number] = BandRadiances(
            number, units, values, quantity, grid if fits else None
        )
    return dict(sorted(bands.items()))


def _grid_of(dataset: "xr.Dataset") -> FixedGrid | None:
    """The fixed grid of a file that cloudjax wrote, None of another projection."""
    axes = [dataset.variables.get(name) for name in ("x", "y")]
    mapping = dataset.variables.get("goes_imager_projection")
    if mapping is None or any(a is None or a.attrs.get("units") != "rad" for a in axes):
        return None
    x, y = (np.asarray(axis, float) for axis in axes)
    longitude = mapping.attrs.get("longitude_of_projection_origin")
    if x.size == 0 or y.size == 0 or not isinstance(longitude, int | float):
        return None
    return FixedGrid(x, y, float(longitude))


def _check_attributes(variable: "xr.DataArray", number: int, path: Path) -> None:
    from cloudjax_data import DataError

    if "units" not in variable.attrs:
        raise DataError(
            f"{path} gives {variable.name} without units: "
            "add the attribute, or write the file with cloudjax."
        )
    if int(variable.attrs.get("abi_band", number)) != number:
        raise DataError(
            f"{path} calls {variable.name} band {variable.attrs['abi_band']}: "
            "correct its name or its attribute abi_band."
        )
    if variable.ndim not in (1, 2):
        raise DataError(
            f"{path} gives {variable.name} on {', '.join(map(str, variable.dims))}: "
            "select one image (y, x) of it."
        )
