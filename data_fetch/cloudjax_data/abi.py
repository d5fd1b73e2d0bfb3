"""One band of one scan is read from an ABI L1b, CMI or multi-band CMI file."""

from dataclasses import dataclass, replace
from datetime import UTC, datetime
from os import PathLike
from pathlib import Path
from typing import Any, Literal, cast

import netCDF4
import numpy as np
from jaxtyping import Bool, Float32

from cloudjax.geometry.fixed_grid import FixedGrid
from cloudjax.geometry.geodesy import Ellipsoid

from .abi_name import parse_abi_name
from .calibration import Calibration, EmissiveCalibration, ReflectiveCalibration
from .errors import DataError
from .fixed_grid import GRID_MAPPING
from .image_part import Box, ImagePart, block_means, image_part
from .packed import attribute, counts, netcdf_file, scalar, scale_and_offset, variable


# PUG volume 3, table of DQF values: the others are out of range, no value, and focal
# plane too warm.
GOOD, CONDITIONALLY_USABLE = 0, 1


@dataclass(frozen=True, eq=False)
class AbiBand:
    """An `AbiBand` holds the radiances of one band.

    **Fields:**

    - `number`: 1 to 16.
    - `wavelength_um`: the central wavelength the file names.
    - `radiance`: in `units`, NaN where not good. Negative values are detector noise
        about zero, legitimate, and kept.
    - `good`: where the quality flag allows use and a value is present.
    - `grid`: the scan angles of the pixels.
    - `calibration`: `ReflectiveCalibration` or `EmissiveCalibration`.
    - `path`: the file.
    - `platform`: "G16" ...; `orbital_slot`: "GOES-East" ..., as the file says.
    - `sector`: "F", "C", "M1" or "M2".
    - `start`, `end`: of the scan, in UTC.
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

    Beyond the result this takes some tens of megabytes, however large the image.

    **Arguments:**

    - `path`: an ABI L1b file (`Rad`), or a CMI file (`CMI` or `CMI_C01` ...), taken
        back to radiance through the coefficients it carries.
    - `band`: which band; needed only for files of many.
    - `keep_conditionally_usable`: also take pixels of quality 1, not only 0.
    - `window`: rows and columns of the file's image, by default all.
    - `block`: average over blocks of so many pixels a side, good where all of them are,
        as `AbiScene.on_common_grid` does. Windows must begin and end at multiples.

    **Raises:** `DataError` if the file is absent, corrupt, of another kind, of another
    band, or has coefficients that contradict each other; or if the window is not in the
    image, or not made of blocks.
    """
    path = Path(path)
    best = CONDITIONALLY_USABLE if keep_conditionally_usable else GOOD
    with netcdf_file(path) as file:
        number, suffix = _which_band(file, path, band)
        calibration = _calibration(file, path, suffix)
        grid = _fixed_grid(file)
        part = image_part(path, grid.shape, window, block)
        radiance, good = _image(file, suffix, calibration, part, best)
        identity = _identity(file, path)
        return AbiBand(
            number=number,
            wavelength_um=round(_number(file, f"band_wavelength{suffix}"), 4),
            radiance=radiance,
            good=good,
            grid=_part_of_grid(grid, part),
            calibration=calibration,
            path=path,
            **identity,
        )


def _which_band(
    file: netCDF4.Dataset, path: Path, wanted: int | None
) -> tuple[int, str]:
    """The band to read, and the suffix its variables bear in this file."""
    many = sorted(int(n[-2:]) for n in file.variables if n.startswith("CMI_C"))
    held = many or [int(_number(file, "band_id"))]
    if wanted is None and len(held) > 1:
        raise DataError(f"{path} holds bands {held}: say which to read.")
    number = held[0] if wanted is None else wanted
    if number not in held:
        raise DataError(
            f"{path} holds band {', '.join(map(str, held))} and not {number}: "
            "check the file name or ask for a band it holds."
        )
    return number, f"_C{number:02d}" if many else ""


def _image(
    file: netCDF4.Dataset,
    suffix: str,
    calibration: Calibration,
    part: ImagePart,
    best: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Radiances, NaN where not good, and where they are good."""
    packed = _packed_image(file, suffix)
    flag = variable(file, f"DQF{suffix}")
    radiance, good = np.empty(part.shape, np.float32), np.empty(part.shape, bool)
    for pixels, blocks in part.tiles(_chunks(packed)):
        values, valid = _radiance(packed, calibration, pixels)
        flags, flagged = counts(flag, pixels)
        usable = valid & flagged & (flags <= best)
        radiance[blocks], good[blocks] = block_means(values, usable, part.block)
    return radiance, good


def _packed_image(file: netCDF4.Dataset, suffix: str) -> netCDF4.Variable:
    return variable(file, "Rad" if "Rad" in file.variables else f"CMI{suffix}")


def _chunks(packed: netCDF4.Variable) -> tuple[int, int]:
    chunks = packed.chunking()
    if not isinstance(chunks, list):
        return 1, packed.shape[1]  # in one piece, row after row
    rows, columns = chunks
    return rows, columns


def _radiance(
    packed: netCDF4.Variable, calibration: Calibration, pixels: Box
) -> tuple[np.ndarray, np.ndarray]:
    stored, valid = counts(packed, pixels)
    scale, offset = scale_and_offset(packed)
    # float32: counts have 14 bits at most, and scale and offset are float32 in the file
    values = stored.astype(np.float32) * np.float32(scale) + np.float32(offset)
    return values if packed.name == "Rad" else calibration.radiance(values), valid


def _calibration(file: netCDF4.Dataset, path: Path, suffix: str) -> Calibration:
    """The coefficients that apply; those of the other kind hold -999."""
    if scalar(file, f"planck_fk1{suffix}") is not None:
        names = ("fk1", "fk2", "bc1", "bc2")
        planck = (_number(file, f"planck_{name}{suffix}") for name in names)
        calibration = EmissiveCalibration(*planck)
    else:
        calibration = ReflectiveCalibration(
            _number(file, f"kappa0{suffix}"),
            _number(file, f"esun{suffix}"),
            _number(file, "earth_sun_distance_anomaly_in_AU"),
        )
    wrong = calibration.inconsistency()
    if wrong is not None:
        raise DataError(f"{path} contradicts itself ({wrong}): download it again.")
    packed = _packed_image(file, suffix)
    if packed.name == "Rad" and isinstance(calibration, EmissiveCalibration):
        scale, offset = scale_and_offset(packed)
        first = (np.floor(-offset / scale) + 1) * scale + offset
        return replace(calibration, smallest_positive_radiance=float(first))
    return calibration


def _fixed_grid(file: netCDF4.Dataset) -> FixedGrid:
    projection = variable(file, GRID_MAPPING)
    sweep = str(attribute(projection, "sweep_angle_axis"))
    return FixedGrid(
        x_rad=_scan_angles(file, "x"),
        y_rad=_scan_angles(file, "y"),
        subsatellite_longitude_deg=float(
            attribute(projection, "longitude_of_projection_origin")
        ),
        perspective_height_m=float(attribute(projection, "perspective_point_height")),
        ellipsoid=Ellipsoid(
            float(attribute(projection, "semi_major_axis")),
            float(attribute(projection, "semi_minor_axis")),
        ),
        sweep=cast(Literal["x", "y"], sweep),
    )


def _part_of_grid(grid: FixedGrid, part: ImagePart) -> FixedGrid:
    x_rad, y_rad = grid.x_rad[part.columns], grid.y_rad[part.rows]
    return replace(grid, x_rad=x_rad, y_rad=y_rad).coarsened(part.block)


def _scan_angles(file: netCDF4.Dataset, name: str) -> np.ndarray:
    packed = variable(file, name)
    stored, _ = counts(packed)
    if stored.dtype.kind == "f":
        # a copy rewritten by xarray holds the decoded angles, in float32
        return np.round(stored.astype(np.float64), 6)
    scale, offset = scale_and_offset(packed)
    # Scale and offset are float32 roundings of multiples of a microradian: undo that,
    # or the far end of a full disk is off by a tenth of a pixel.
    return stored.astype(np.float64) * round(scale, 6) + round(offset, 6)


def _identity(file: netCDF4.Dataset, path: Path) -> dict[str, Any]:
    # the header knows its original name; the file may have been renamed
    name = parse_abi_name(str(attribute(file, "dataset_name")))
    name = name or parse_abi_name(path.name)
    scene = str(attribute(file, "scene_id"))
    return {
        "platform": str(attribute(file, "platform_ID")),
        "orbital_slot": str(attribute(file, "orbital_slot")),
        "sector": name.sector if name else scene[:1],
        "start": _time(file, path, "time_coverage_start"),
        "end": _time(file, path, "time_coverage_end"),
    }


def _time(file: netCDF4.Dataset, path: Path, name: str) -> datetime:
    text = str(attribute(file, name))
    try:
        return datetime.fromisoformat(text).astimezone(UTC)
    except ValueError as error:
        raise DataError(
            f"{path} has {name} {text!r}, which is no time: download it again."
        ) from error


def _number(file: netCDF4.Dataset, name: str) -> float:
    value = scalar(file, name)
    if value is None:
        raise DataError(
            f"{file.filepath()} has no value for {name!r}: it is not a complete ABI "
            "L1b or CMI file, download it again."
        )
    return value
