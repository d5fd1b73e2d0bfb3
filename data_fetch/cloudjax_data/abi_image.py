"""The radiances of a file of ABI, out of whatever it stores them in."""

from dataclasses import dataclass
from pathlib import Path

import netCDF4
import numpy as np
from jaxtyping import Float32

from .calibration import (
    WAVELENGTH_UNITS,
    WAVENUMBER_UNITS,
    Calibration,
    EmissiveCalibration,
    ReflectiveCalibration,
)
from .errors import DataError
from .image_part import Box
from .image_plane import ImagePlane
from .nominal import lost_offset
from .packed import scalar, scale_and_offset


# No scene is darker or brighter: the packing of ABI reaches from -0.05 to 1.5, and its
# hottest pixels are fires of 412 K.
_REFLECTANCE = (-0.2, 3.0)
_HOTTEST_K = 450.0
# Noise about zero, as a share of the radiance of 300 K; CMI files begin at 89 K.
_NOISE = 0.2
_COLDEST_K = 80.0
_BEYOND_K = 30.0

_SAME_UNITS = {
    WAVELENGTH_UNITS: ("W m-2 sr-1 um-1", "W/(m2 sr um)", "W m^-2 sr^-1 um^-1"),
    WAVENUMBER_UNITS: (
        "mW m-2 sr-1 (cm-1)-1",
        "mW/(m2 sr cm-1)",
        "mW m^-2 sr^-1 (cm^-1)^-1",
    ),
    "1": ("1", "", "unitless", "dimensionless"),
    "K": ("K", "kelvin"),
}


@dataclass(frozen=True)
class PackedImage:
    """A `PackedImage` is an image of radiance, or of reflectance or brightness
    temperature, and how to read radiances of it.
    """

    plane: ImagePlane
    calibration: Calibration
    scale: float
    offset: float

    def radiance(self, pixels: Box) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Read radiances [y, x], where there is a value, and where it is one that a
        scene can have.
        """
        stored, present = self.plane.counts(pixels)
        # float32 for counts of ABI, which have 16 bits at most: scale and offset are
        # float32 in the file
        wide = stored.dtype.itemsize > 2 and stored.dtype != np.float32
        kind = np.float64 if wide else np.float32
        with np.errstate(over="ignore", invalid="ignore"):
            values = stored.astype(kind) * kind(self.scale) + kind(self.offset)
            low, high = self._possible()
            possible = (values >= low) & (values <= high)
            values = np.where(present & possible, values, kind(high))
        if self.plane.variable.name != "Rad":
            values = self.calibration.radiance(values)
        return values.astype(np.float32), present, possible

    def _possible(self) -> tuple[float, float]:
        """The lowest and the highest value, in what the file stores."""
        calibration = self.calibration
        if isinstance(calibration, ReflectiveCalibration):
            if self.plane.variable.name != "Rad":
                return _REFLECTANCE
            low, high = (float(x) for x in calibration.radiance(np.array(_REFLECTANCE)))
            return low, high
        if self.plane.variable.name != "Rad":
            return _COLDEST_K, _HOTTEST_K
        usual, highest = calibration.radiance(np.array([300.0, _HOTTEST_K]))
        return -_NOISE * float(usual), float(highest)


def packed_image(
    path: Path, plane: ImagePlane, number: int, calibration: Calibration
) -> PackedImage:
    """Find out how an image is packed.

    **Raises:** `DataError` if its packing is none, or its units are not those of what
    it should hold.
    """
    expected = calibration.units
    if plane.variable.name != "Rad":
        expected = "K" if isinstance(calibration, EmissiveCalibration) else "1"
    given = str(getattr(plane.variable, "units", expected))
    if _plain(given) not in map(_plain, _SAME_UNITS[expected]):
        raise DataError(
            f"{path} gives band {number} in {given!r} and not in {expected!r}: "
            "download it again."
        )
    from_zero = expected == "1"
    scale, offset = scale_and_offset(plane.variable, from_zero=from_zero)
    if plane.variable.name == "Rad" and lost_offset(number, scale, offset):
        raise DataError(
            f"{path} packs band {number} with the scale of ABI and an offset of "
            f"{offset:g}, which is not ABI's: download it again."
        )
    if not scale > 0:
        raise DataError(
            f"{path} packs band {number} with a scale of {scale:g}, and those of ABI "
            "are positive: download it again."
        )
    return PackedImage(plane, calibration, scale, offset)


def check_extremes(
    file: netCDF4.Dataset,
    path: Path,
    suffix: str,
    radiance: Float32[np.ndarray, "y x"],
    calibration: Calibration,
) -> None:
    """Check brightness temperatures against the extremes that a CMI file tells.

    A part of an image lies within them, and so does one that was changed a little.

    **Raises:** `DataError` if some are tens of kelvins beyond: the packing is lost.
    """
    ends = [scalar(file, f"{e}_brightness_temperature{suffix}") for e in ("min", "max")]
    low, high = ends
    known = radiance[np.isfinite(radiance)]
    if low is None or high is None or not known.size:
        return
    if not isinstance(calibration, EmissiveCalibration):
        return
    found = calibration.brightness_temperature_k(np.array([known.min(), known.max()]))
    if found[0] < low - _BEYOND_K or found[1] > high + _BEYOND_K:
        raise DataError(
            f"{path} contradicts itself (it tells temperatures of {low:.0f} to "
            f"{high:.0f} K and holds {found[0]:.0f} to {found[1]:.0f} K): download it "
            "again."
        )


def _plain(units: str) -> str:
    return units.replace(" ", "").lower()
