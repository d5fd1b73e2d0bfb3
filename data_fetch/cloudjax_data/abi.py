"""One band of one scan is read from an ABI L1b, CMI or multi-band CMI file."""

import re
from dataclasses import dataclass, replace
from datetime import datetime
from os import PathLike
from pathlib import Path

import netCDF4
import numpy as np
from jaxtyping import Bool, Float32

from cloudjax.geometry.fixed_grid import FixedGrid

from .abi_calibration import read_calibration
from .abi_grid import read_fixed_grid
from .abi_identity import AbiIdentity, read_identity
from .abi_image import PackedImage, check_extremes, packed_image
from .calibration import Calibration
from .errors import DataError
from .image_part import Box, ImagePart, block_means, image_part
from .image_plane import ImagePlane, image_plane
from .nominal import nominal
from .packed import netcdf_file, scalar


# PUG volume 3, table of DQF values: the others are out of range, no value, and focal
# plane too warm.
GOOD, CONDITIONALLY_USABLE = 0, 1

_OF_MANY = re.compile(r"CMI_C(?P<band>\d\d)")
# No file's wavelength is further from the nominal one; bands lie 6 % apart.
_WAVELENGTH_TOLERANCE = 0.015


@dataclass(frozen=True, eq=False)
class AbiBand:
    """An `AbiBand` holds the radiances of one band.

    **Fields:**

    - `number`: 1 to 16.
    - `wavelength_um`: the central wavelength the file names.
    - `radiance`: in `units`, NaN where not good. Negative values are detector noise
        about zero, legitimate, and kept.
    - `good`: where the quality flag allows use, a value is present and possible, and
        the pixel sees the Earth.
    - `grid`: the scan angles of the pixels.
    - `calibration`: `ReflectiveCalibration` or `EmissiveCalibration`.
    - `path`: the file.
    - `platform`: "G16" ...; `orbital_slot`: "GOES-East" ..., as the file says.
    - `sector`: "F", "C", "M1" or "M2".
    - `start`, `end`: of the scan, in UTC.
    - `notes`: sentences on what had to be assumed.
    """

    number: int
    wavelength_um: float
    radiance: Float32[np.ndarray, "y x"]
    good: Bool[np.ndarray, "y x"]
    grid: FixedGrid
    calibration: Calibration
    path: Path
    platform: str
    orbital_slot: str
    sector: str
    start: datetime
    end: datetime
    notes: tuple[str, ...] = ()

    @property
    def units(self) -> str:
        """Give the units of the radiance; they differ between bands 6 and 7."""
        return self.calibration.units

    @property
    def time(self) -> datetime:
        """Give the middle of the scan."""
        return self.start + (self.end - self.start) / 2


def read_band(
    path: str | PathLike[str],
    *,
    band: int | None = None,
    keep_conditionally_usable: bool = False,
    window: Box | None = None,
    block: int = 1,
) -> AbiBand:
    """Read one band from a file of NOAA, tile by tile.

    Beyond the result this takes some tens of megabytes, however large the image. Rows
    come from the north and columns from the west, in whatever order they are stored.

    **Arguments:**

    - `path`: an ABI L1b file (`Rad`), or a CMI file (`CMI` or `CMI_C01` ...), taken
        back to radiance through the coefficients it carries, or nominal ones.
    - `band`: which band; needed only for files of many.
    - `keep_conditionally_usable`: also take pixels of quality 1, not only 0.
    - `window`: rows and columns of the file's image, as stored, by default all.
    - `block`: average over blocks of so many pixels a side, good where all of them are,
        as `AbiScene.on_common_grid` does. Windows must begin and end at multiples.

    **Raises:** `DataError` if the file is absent, corrupt, of another kind, of another
    band, or contradicts itself; or if the window is not in the image, or not made of
    blocks.
    """
    path = Path(path)
    with netcdf_file(path) as file:
        number, suffix = _which_band(file, path, band)
        packed, flags = _planes(file, suffix)
        identity = read_identity(file, path, number)
        image, notes = _calibrated(file, path, suffix, number, packed, identity)
        grid = read_fixed_grid(file)
        part = image_part(path, grid.shape, window, block)
        best = CONDITIONALLY_USABLE if keep_conditionally_usable else GOOD
        radiance, good, impossible = _image(image, flags, grid, part, best)
        check_extremes(file, path, suffix, radiance, image.calibration)
        return _from_north_west(
            AbiBand(
                number=number,
                wavelength_um=_wavelength(file, path, number, suffix),
                radiance=radiance,
                good=good,
                grid=_part_of_grid(grid, part),
                calibration=image.calibration,
                path=path,
                **vars(identity),
                notes=notes + _impossible(path, number, impossible, good),
            )
        )


def bands_of(file: netCDF4.Dataset) -> list[int]:
    """Return the bands that a file holds, by its variables."""
    many = (_OF_MANY.fullmatch(name) for name in file.variables)
    found = sorted(int(match["band"]) for match in many if match)
    return [number for number in found if 1 <= number <= 16]


def _which_band(
    file: netCDF4.Dataset, path: Path, wanted: int | None
) -> tuple[int, str]:
    """The band to read, and the suffix its variables bear in this file."""
    many = bands_of(file)
    held = many or [_only_band(file, path)]
    if wanted is None and len(held) > 1:
        raise DataError(f"{path} holds bands {held}: say which to read.")
    number = held[0] if wanted is None else wanted
    if number not in held:
        raise DataError(
            f"{path} holds band {', '.join(map(str, held))} and not {number}: "
            "check the file name or ask for a band it holds."
        )
    suffix = f"_C{number:02d}" if many else ""
    said = scalar(file, f"band_id{suffix}")
    if said not in (None, number):
        raise DataError(f"{path} calls 'CMI{suffix}' band {said:g}: download it again.")
    return number, suffix


def _only_band(file: netCDF4.Dataset, path: Path) -> int:
    number = scalar(file, "band_id")
    if number is None or number not in range(1, 17):
        said = "no value" if number is None else f"{number:g}"
        raise DataError(
            f"{path} has {said} for 'band_id': it is not a complete ABI L1b or CMI "
            "file, download it again."
        )
    return int(number)


def _planes(file: netCDF4.Dataset, suffix: str) -> tuple[ImagePlane, ImagePlane]:
    """The image and its quality flags."""
    name = "Rad" if "Rad" in file.variables and not suffix else f"CMI{suffix}"
    packed, flags = image_plane(file, name), image_plane(file, f"DQF{suffix}")
    if packed.shape != flags.shape:
        raise DataError(
            f"{file.filepath()} has quality flags for {flags.shape} pixels and not for "
            f"{packed.shape}: download it again."
        )
    return packed, flags


def _calibrated(
    file: netCDF4.Dataset,
    path: Path,
    suffix: str,
    number: int,
    plane: ImagePlane,
    identity: AbiIdentity,
) -> tuple[PackedImage, tuple[str, ...]]:
    """The image with its calibration, and what had to be assumed for it."""
    calibration, notes = read_calibration(
        file, path, suffix, number, identity.platform, identity.start
    )
    return packed_image(path, plane, number, calibration), notes


def _image(
    image: PackedImage, flags: ImagePlane, grid: FixedGrid, part: ImagePart, best: int
) -> tuple[np.ndarray, np.ndarray, int]:
    """Radiances, NaN where not good, where they are good, and how many flagged as good
    are of no possible size.
    """
    radiance, good = np.empty(part.shape, np.float32), np.empty(part.shape, bool)
    impossible = 0
    for pixels, blocks in part.tiles(image.plane.chunks):
        values, present, possible = image.radiance(pixels)
        flag, flagged = flags.counts(pixels)
        usable = present & flagged & (flag >= GOOD) & (flag <= best)
        y_rad, x_rad = grid.y_rad[pixels[0]], grid.x_rad[pixels[1]]
        usable &= replace(grid, x_rad=x_rad, y_rad=y_rad).sees_the_earth()
        impossible += int((usable & ~possible).sum())
        values = np.where(possible, values, np.float32(0))
        radiance[blocks], good[blocks] = block_means(
            values, usable & possible, part.block
        )
    return radiance, good, impossible


def _impossible(
    path: Path, number: int, count: int, good: np.ndarray
) -> tuple[str, ...]:
    """What to say of pixels whose radiance no scene has."""
    if count == 0:
        return ()
    if not good.any():
        raise DataError(
            f"{path} has no radiance of band {number} that a scene can have: its "
            "packing or its units are not those it states, download it again."
        )
    return (
        f"{path.name} has {count} pixels of a radiance that no scene has, and flags "
        "them as good: they are left out.",
    )


def _wavelength(file: netCDF4.Dataset, path: Path, number: int, suffix: str) -> float:
    usual = nominal("", number).wavelength_um
    found = scalar(file, f"band_wavelength{suffix}")
    if found is None:
        return usual
    if abs(found / usual - 1) > _WAVELENGTH_TOLERANCE:
        raise DataError(
            f"{path} contradicts itself (band {number} is at {found:g} um, and "
            f"{usual:g} nominally): download it again."
        )
    return round(found, 4)


def _part_of_grid(grid: FixedGrid, part: ImagePart) -> FixedGrid:
    x_rad, y_rad = grid.x_rad[part.columns], grid.y_rad[part.rows]
    return replace(grid, x_rad=x_rad, y_rad=y_rad).coarsened(part.block)


def _from_north_west(band: AbiBand) -> AbiBand:
    grid = band.grid
    rows = slice(None, None, -1 if grid.y_rad[0] < grid.y_rad[-1] else 1)
    columns = slice(None, None, -1 if grid.x_rad[0] > grid.x_rad[-1] else 1)
    if rows.step == columns.step == 1:
        return band
    turned = replace(
        grid, x_rad=grid.x_rad[columns].copy(), y_rad=grid.y_rad[rows].copy()
    )
    return replace(
        band,
        radiance=band.radiance[rows, columns].copy(),
        good=band.good[rows, columns].copy(),
        grid=turned,
    )
