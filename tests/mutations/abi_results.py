"""What a folder of ABI files is read as, and how two of these differ."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cloudjax_data import AbiBand, ReflectiveCalibration, open_folder


@dataclass(frozen=True, eq=False)
class AbiResult:
    """A band as it was read, and what people look at of it."""

    band: AbiBand
    shown: np.ndarray


def read_result(folder: Path) -> AbiResult:
    """Read the only band of a folder."""
    held = open_folder(folder)
    (band,) = held.read(list(held.bands)[:1]).bands.values()
    calibration = band.calibration
    if isinstance(calibration, ReflectiveCalibration):
        return AbiResult(band, calibration.reflectance(band.radiance))
    return AbiResult(band, calibration.brightness_temperature_k(band.radiance))


def difference(found: AbiResult, right: AbiResult, may_lose: bool) -> str | None:
    """What has changed in silence, in words, or None.

    Pixels may be lost, or a coefficient be nominal, if a note says so; and an image may
    have lost rows and columns, with their scan angles.

    **Arguments:** `may_lose`: whether the file says itself that pixels are missing.
    """
    a, b = found.band, right.band
    for name in ("number", "platform", "orbital_slot", "sector", "start", "end"):
        if getattr(a, name) != getattr(b, name):
            return f"has {name} {getattr(a, name)} and not {getattr(b, name)}"
    if not np.isclose(a.wavelength_um, b.wavelength_um, rtol=2e-2):
        return f"has a wavelength of {a.wavelength_um}"
    if not a.grid.same_projection_as(b.grid):
        return "has another projection"
    rows, columns = (
        _places(a.grid.y_rad, b.grid.y_rad),
        _places(a.grid.x_rad, b.grid.x_rad),
    )
    if rows is None or columns is None:
        return "has other scan angles"
    return _of_pixels(found, right, np.ix_(rows, columns), may_lose)


def _places(found: np.ndarray, right: np.ndarray) -> np.ndarray | None:
    """Where angles are among others; None where one is not."""
    places = np.abs(found[:, None] - right).argmin(axis=1)
    close = np.abs(found - right[places]) < 1e-7
    return places if close.all() else None


def _of_pixels(found: AbiResult, right: AbiResult, where, may_lose: bool) -> str | None:
    good, expected = found.band.good, right.band.good[where]
    if (good & ~expected).any():
        return "believes pixels that are not good"
    if (good != expected).any() and not found.band.notes and not may_lose:
        return "loses pixels in silence"
    # Nominal coefficients are others than those of the file, by less than a percent.
    told = any("nominal" in note or "date does" in note for note in found.band.notes)
    radiance = found.band.radiance[good], right.band.radiance[where][good]
    if not np.allclose(*radiance, rtol=0.05 if told else 2e-6, atol=1e-6):
        return "has other radiances"
    shown = found.shown[good], right.shown[where][good]
    if not np.allclose(*shown, rtol=0.02 if told else 1e-5, atol=1e-5):
        return "has other reflectances or temperatures"
    return None
