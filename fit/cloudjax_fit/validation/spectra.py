"""Power spectra along the rows of an image, in kilometres, and their slopes."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Num

from cloudjax.geometry.geodesy import ecef
from cloudjax_fit.plain_data import plain


# Observed fields of cloud have spectra between these (Cahalan & Snider 1989, Remote
# Sens. Environ. 28, 95: -5/3; Nastrom & Gage 1985, J. Atmos. Sci. 42, 950: winds and
# temperatures -5/3 up to some 400 km and -3 beyond).
SHALLOW, STEEP = -5 / 3, -3.0
SHORTEST_KM, LONGEST_KM = 50.0, 500.0
# Of neighbours in a row or column: where they are further apart the row is cut off.
_MOST_STRETCH = 1.25
# Of a wavelength: pixels that it takes to be free of what is not resolved, and the
# waves of a row that make it free of the window.
_PIXELS, _WAVES = 3.0, 4.0
_LEAST_COLUMNS, _LEAST_ROWS = 32, 4
_BINS_PER_OCTAVE = 3
_LEAST_BINS = 3


@dataclass(frozen=True, eq=False)
class RowSpectrum:
    """A `RowSpectrum` is the mean power spectrum of the rows of an image.

    **Fields:**

    - `wavelength_km`: falling, each the middle of a third of an octave.
    - `power`: density over wavenumber [square of the image's unit, km].
    - `slope`: of the logarithms of power and wavenumber, NaN without enough waves.
    - `fitted_km`: the longest and the shortest wave between which it is fitted.
    - `rows`, `columns`, `pixel_km`: of what is taken.
    """

    wavelength_km: Float[np.ndarray, " waves"]
    power: Float[np.ndarray, " waves"]
    slope: float
    fitted_km: tuple[float, float]
    rows: int
    columns: int
    pixel_km: float

    def line(self, slope: float) -> Float[np.ndarray, " waves"]:
        """Return a power law of this slope through the middle of the fitted waves."""
        log_k, log_p = -np.log(self.wavelength_km), np.log(self.power)
        longest, shortest = self.fitted_km
        inside = (self.wavelength_km <= longest) & (self.wavelength_km >= shortest)
        inside = inside if inside.any() else np.ones(inside.shape, bool)
        return np.exp(log_p[inside].mean() + slope * (log_k - log_k[inside].mean()))

    def numbers(self) -> dict[str, Any]:
        """Return all of it as plain data; None stands for what is not known."""
        return {
            "slope": plain(self.slope),
            "fitted_km": list(self.fitted_km),
            "rows": self.rows,
            "columns": self.columns,
            "pixel_km": self.pixel_km,
            "wavelength_km": self.wavelength_km.tolist(),
            "power": self.power.tolist(),
        }


@dataclass(frozen=True)
class FinestPart:
    """The `FinestPart` of an image is the block of pixels about its finest one whose
    distances are alike: about the sub-satellite point of a full disc.
    """

    rows: slice
    columns: slice
    pixel_km: float


def finest_part(
    latitude_deg: Float[np.ndarray, "y x"],
    longitude_deg: Float[np.ndarray, "y x"],
    area_m2: Float[np.ndarray, "y x"],
) -> FinestPart | None:
    """Find the part along whose rows spectra are taken; None for one too small."""
    if not np.isfinite(area_m2).any():
        return None
    row, column = np.unravel_index(np.nanargmin(area_m2), area_m2.shape)
    down = _alike(
        _steps_km(latitude_deg[:, column], longitude_deg[:, column]), int(row)
    )
    across = _alike(_steps_km(latitude_deg[row], longitude_deg[row]), int(column))
    latitude, longitude = (x[down, across] for x in (latitude_deg, longitude_deg))
    if latitude.shape[0] < _LEAST_ROWS or latitude.shape[1] < _LEAST_COLUMNS:
        return None
    steps = [_steps_km(φ, λ).mean() for φ, λ in zip(latitude, longitude, strict=True)]
    return FinestPart(down, across, float(np.nanmean(steps)))


def row_spectrum(image: Num[np.ndarray, "y x"], pixel_km: float) -> RowSpectrum | None:
    """Find the mean spectrum of the rows that are whole; None if they are few.

    Each row loses its straight line, and is seen through a Hann window.
    """
    rows = np.asarray(image, float)
    rows = rows[np.isfinite(rows).all(axis=1)]
    if rows.shape[0] < _LEAST_ROWS or rows.shape[1] < _LEAST_COLUMNS:
        return None
    count = rows.shape[1]
    x = np.arange(count) - (count - 1) / 2
    rows = rows - rows.mean(axis=1, keepdims=True)
    rows = rows - (rows @ x / (x @ x))[:, None] * x
    window = np.hanning(count)
    density = 2 * pixel_km * np.abs(np.fft.rfft(rows * window)) ** 2 / (window @ window)
    k = np.fft.rfftfreq(count, pixel_km)[1:]
    wavelength, power = _in_bins(k, density.mean(axis=0)[1:])
    if not (power > 0).all():
        return None
    longest = min(LONGEST_KM, count * pixel_km / _WAVES)
    shortest = max(SHORTEST_KM, _PIXELS * pixel_km)
    slope = _slope(wavelength, power, longest, shortest)
    fitted = float(longest), float(shortest)
    return RowSpectrum(wavelength, power, slope, fitted, len(rows), count, pixel_km)


def _steps_km(latitude_deg, longitude_deg) -> Float[np.ndarray, " steps"]:
    place = ecef(latitude_deg, longitude_deg, np.zeros(latitude_deg.shape))
    return np.linalg.norm(np.diff(place, axis=0), axis=-1) / 1e3


def _alike(steps_km: Float[np.ndarray, " steps"], at: int) -> slice:
    """The pixels about one between which steps are hardly longer than the shortest."""
    near = np.nan_to_num(steps_km, nan=np.inf) <= _MOST_STRETCH * np.nanmin(steps_km)
    first, last = at, at
    while first > 0 and near[first - 1]:
        first -= 1
    while last < len(near) and near[last]:
        last += 1
    return slice(first, last + 1)


def _in_bins(k, density):
    """Means in thirds of octaves of those that hold a wave, from long to short."""
    place = np.floor(_BINS_PER_OCTAVE * np.log2(k / k[0]) + 0.5).astype(int)
    number = np.bincount(place)
    held = number > 0
    log_k = np.bincount(place, np.log(k))[held] / number[held]
    return np.exp(-log_k), np.bincount(place, density)[held] / number[held]


def _slope(wavelength_km, power, longest: float, shortest: float) -> float:
    inside = (wavelength_km <= longest) & (wavelength_km >= shortest)
    if inside.sum() < _LEAST_BINS:
        return math.nan
    return float(
        np.polyfit(-np.log(wavelength_km[inside]), np.log(power[inside]), 1)[0]
    )
