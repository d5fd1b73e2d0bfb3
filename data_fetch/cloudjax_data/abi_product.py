"""One physical quantity of one scan is read from an L2 file of ABI.

Some who pass on such files rename their variables, drop the projection and all that
tells the scan, but keep the attributes of the variables and the name of the file.
"""

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import netCDF4
import numpy as np
from jaxtyping import Bool, Float

from cloudjax.geometry.fixed_grid import FixedGrid

from .abi_flags import AbiFlags, read_flags
from .abi_grid import SLOTS_DEG, read_fixed_grid, read_scan_angles
from .abi_identity import middle_of_scan, read_identity
from .abi_name import parse_abi_name
from .errors import DataError
from .grid_mapping import GRID_MAPPING
from .image_plane import image_plane
from .packed import netcdf_file, scale_and_offset
from .satellites import position_at


_PLACES = {"latitude": ("lat", "latitude"), "longitude": ("lon", "longitude")}
_METRES = ("m", "meter", "meters", "metre", "metres")
# How far the places in a file may be from its scan angles, in pixels.
_SAME_PLACE = 0.5


@dataclass(frozen=True)
class Quantity:
    """A `Quantity` is what a product holds.

    **Fields:** `product`: as NOAA calls it; `variable`: its name in NOAA's files;
    `standard_name`: of the variable; `units`: all that mean the same.
    """

    product: str
    variable: str
    standard_name: str
    units: tuple[str, ...]


OPTICAL_DEPTH = Quantity(
    "COD", "COD", "atmosphere_optical_thickness_due_to_cloud", ("1", "", "none")
)
TOP_HEIGHT = Quantity("ACHA", "HT", "geopotential_height_at_cloud_top", _METRES)


@dataclass(frozen=True, eq=False)
class AbiProduct:
    """An `AbiProduct` is an image of one quantity.

    **Fields:**

    - `path`: the file.
    - `values`: unpacked, NaN where there is none.
    - `flags`: of their quality.
    - `grid`: scan angles of the pixels, in the order of the file.
    - `platform`: "G16" ...; `sector`: "F", "C", "M1" or "M2".
    - `time`: middle of the scan, in UTC, or its start where the file tells no more.
    """

    path: Path
    values: Float[np.ndarray, "y x"]
    flags: AbiFlags
    grid: FixedGrid
    platform: str
    sector: str
    time: datetime

    @property
    def good(self) -> Bool[np.ndarray, "y x"]:
        """Tell where there is a value that the flags let count."""
        return np.isfinite(self.values) & self.flags.usable


def read_product(path: Path, quantity: Quantity) -> AbiProduct:
    """Read an image of a quantity, found by its standard name or NOAA's own name.

    Without a projection the satellite stands where its name and the time say, else
    where the latitudes and longitudes of the file are those of its scan angles.

    **Raises:** `DataError` if the file is broken, holds something else, does not tell
    its scan or where its satellite stood, or contradicts itself.
    """
    with netcdf_file(path) as file:
        name = _variable_name(file, path, quantity)
        plane = image_plane(file, name)
        every = slice(None), slice(None)
        stored, valid = plane.counts(every)
        scale, offset = scale_and_offset(plane.variable, from_zero=True)
        flags = read_flags(file, _flags_name(file, path, name))
        platform, sector, time = _scan(file, path)
        grid = _grid(file, path, platform, time)
    values = np.where(valid, stored * float(scale) + float(offset), np.nan)
    if not values.shape == flags.stored.shape == grid.shape:
        raise DataError(
            f"{path} has {name!r}, its quality flags and its scan angles for images of "
            "different sizes: download it again."
        )
    return AbiProduct(path, values, flags, grid, platform, sector, time)


def _variable_name(file: netCDF4.Dataset, path: Path, quantity: Quantity) -> str:
    wanted = quantity.standard_name
    found = [n for n, v in file.variables.items() if _said(v) == wanted]
    if not found and quantity.variable in file.variables:
        found = [quantity.variable]
    if len(found) != 1:
        held = "several variables" if found else "no variable"
        raise DataError(
            f"{path} has {held} of the standard name {wanted!r}: it is no "
            f"{quantity.product} file as NOAA writes it, download it again."
        )
    units = str(getattr(file.variables[found[0]], "units", "")).strip().lower()
    if units not in quantity.units:
        raise DataError(
            f"{path} has {found[0]!r} in {units!r}, and {quantity.product} is in "
            f"{quantity.units[0]!r}: download it again."
        )
    return found[0]


def _flags_name(file: netCDF4.Dataset, path: Path, name: str) -> str:
    on = file.variables[name].dimensions
    flags = [
        n
        for n, v in file.variables.items()
        if v.dimensions == on and (n == "DQF" or _said(v) == "status_flag")
    ]
    if len(flags) != 1:
        raise DataError(
            f"{path} has not one variable of quality flags, and nothing says which of "
            "its pixels count: get the file again, with its DQF."
        )
    return flags[0]


def _said(variable: netCDF4.Variable) -> str:
    return str(getattr(variable, "standard_name", ""))


def _scan(file: netCDF4.Dataset, path: Path) -> tuple[str, str, datetime]:
    """Platform, sector and time, by the header where it has them, else by the name."""
    if "platform_ID" in file.ncattrs():
        identity = read_identity(file, path, 0)
        middle = identity.start + (identity.end - identity.start) / 2
        return identity.platform, identity.sector, middle
    name = parse_abi_name(path.name)
    if name is None:
        raise DataError(
            f"{path} tells its satellite and its time neither in its header nor in its "
            "name: give it the name that NOAA gave it."
        )
    return name.platform, name.sector, middle_of_scan(file) or name.start


def _grid(
    file: netCDF4.Dataset, path: Path, platform: str, time: datetime
) -> FixedGrid:
    if GRID_MAPPING in file.variables:
        grid = read_fixed_grid(file)
    else:
        x, y = (read_scan_angles(file, n, _HEIGHT_M) for n in ("x", "y"))
        held = position_at(f"goes{platform[1:]}", time)
        slot = SLOTS_DEG.get(f"GOES-{held.capitalize()}") if held else None
        grid = FixedGrid(x, y, 0.0 if slot is None else slot)
        if slot is None:
            grid = FixedGrid(x, y, _by_places(file, path, grid))
    if min(grid.shape) < 2:
        raise DataError(f"{path} has a single row of pixels: get more of the scan.")
    _check_places(file, path, grid)
    return grid


# Of all ABI.
_HEIGHT_M = FixedGrid.perspective_height_m


def _places(file: netCDF4.Dataset) -> tuple[np.ndarray, np.ndarray] | None:
    """Latitudes and longitudes of the pixels, where the file has them."""
    found = []
    for standard, names in _PLACES.items():
        held = [
            n
            for n, v in file.variables.items()
            if v.ndim == 2 and (n in names or _said(v) == standard)
        ]
        if not held:
            return None
        plane = image_plane(file, held[0])
        stored, valid = plane.counts((slice(None), slice(None)))
        scale, offset = scale_and_offset(plane.variable, from_zero=True)
        values = stored.astype(float) * scale + offset
        found.append(np.where(valid & (np.abs(values) <= 360), values, np.nan))
    return found[0], found[1]


def _by_places(file: netCDF4.Dataset, path: Path, grid: FixedGrid) -> float:
    """The longitude beneath the satellite: turned about the axis a disc is the same.

    **Arguments:** `grid`: over longitude 0.
    """
    places = _places(file)
    if places is None:
        raise DataError(
            f"{path} has no {GRID_MAPPING} and no latitudes and longitudes, and at its "
            "time its satellite stood in neither of the usual positions: get a file "
            "with its projection."
        )
    ground, hit = grid.rays().ground()
    relative = np.where(hit, ground.longitude_deg, np.nan).reshape(grid.shape)
    turned = np.exp(1j * np.radians(places[1] - relative))
    if not np.isfinite(turned).any():
        raise DataError(f"{path} has no latitudes and longitudes: get another file.")
    return round(float(np.degrees(np.angle(np.nanmean(turned)))), 2)


def _check_places(file: netCDF4.Dataset, path: Path, grid: FixedGrid) -> None:
    """The places in a file must be those that its pixels see."""
    places = _places(file)
    if places is None or places[0].shape != grid.shape:
        return
    known = np.isfinite(places[0]) & np.isfinite(places[1])
    x, y = grid.angles_of(places[0][known], places[1][known])
    row, column = np.nonzero(known)
    off = np.maximum(np.abs(x - grid.x_rad[column]), np.abs(y - grid.y_rad[row]))
    if off.size and np.median(off) > _SAME_PLACE * grid.step_rad:
        raise DataError(
            f"{path} contradicts itself (its latitudes and longitudes are not those of "
            "its scan angles, seen from above longitude "
            f"{grid.subsatellite_longitude_deg:g}): download it again."
        )
