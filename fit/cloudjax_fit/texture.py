"""How images vary from place to place, scale by scale: spectra and increments.

Scales are in pixels: those of a fixed grid are as many kilometres only below the
satellite.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Num

from .functionals import LAGS
from .plain_data import plain


SHORTEST_WAVELENGTH = 2.0
# Of an image whose texture is worth a figure.
FEWEST_ROWS = 16


@dataclass(frozen=True, eq=False)
class Texture:
    """A `Texture` tells how much an image varies, scale by scale.

    **Fields:**

    - `wavelength`: the longest of each octave, in pixels, falling.
    - `power`: mean power of each octave, in squares of the image's unit.
    - `lag`: between pixels, in pixels.
    - `increment`: mean size of the difference of two pixels so far apart, in the
      image's unit; NaN where there is no pair.
    """

    wavelength: Float[np.ndarray, " octaves"]
    power: Float[np.ndarray, " octaves"]
    lag: Float[np.ndarray, " lags"]
    increment: Float[np.ndarray, " lags"]


def texture(
    image: Num[np.ndarray, "y x"],
    known: Bool[np.ndarray, "y x"],
    counted: Bool[np.ndarray, "y x"] | None = None,
) -> Texture:
    """Measure the texture of an image.

    The power is that of the departures from the mean, under a Hann window. Pixels that
    are not known count as the mean: images are compared over the same ones.

    **Arguments:** `known`: pixels with data; `counted`: those whose increments count,
    both of a pair; by default all that are known.
    """
    values = np.where(known, image, 0.0).astype(np.float32)
    mean = values.sum(dtype=float) / max(known.sum(), 1)
    anomaly = np.where(known, values - np.float32(mean), np.float32(0))
    longest, power = _power(anomaly)
    lags = [lag for lag in LAGS if lag < min(image.shape)]
    counted = known if counted is None else known & counted
    increment = [_increment(anomaly, counted, lag) for lag in lags]
    return Texture(longest, power, np.array(lags, float), np.array(increment, float))


def _increment(values, counted, lag: int) -> float:
    """Mean over rows and columns. Lists of all pairs of a full disc take gigabytes."""
    total = number = 0
    for axis in (0, 1):
        length = values.shape[axis] - lag
        first, second = (
            tuple(
                slice(start, start + length) if i == axis else slice(None)
                for i in (0, 1)
            )
            for start in (0, lag)
        )
        both = counted[first] & counted[second]
        total += np.abs(values[second] - values[first])[both].sum(dtype=float)
        number += np.count_nonzero(both)
    return total / number if number else np.nan


@dataclass(frozen=True, eq=False)
class TexturePair:
    """A `TexturePair` is of two images of one shape, the reference first."""

    reference: Texture
    other: Texture

    @property
    def power_ratio_db(self) -> Float[np.ndarray, " octaves"]:
        """Tell how much more power the other one has; NaN where either has none."""
        return 10 * _log10_ratio(self.other.power, self.reference.power)

    @property
    def increment_ratio(self) -> Float[np.ndarray, " lags"]:
        """Tell how much larger increments of the other are; NaN where one has none."""
        return 10 ** _log10_ratio(self.other.increment, self.reference.increment)

    def numbers(self) -> dict[str, list[float | None]]:
        """Return the comparison as plain data; None stands for what is not finite."""
        found = {
            "wavelength_pixels": self.reference.wavelength,
            "power_ratio_db": self.power_ratio_db,
            "lag_pixels": self.reference.lag,
            "increment_ratio": self.increment_ratio,
        }
        return {
            name: plain([float(n) for n in numbers]) for name, numbers in found.items()
        }


def _log10_ratio(a, b):
    known = (a > 0) & (b > 0)
    return np.log10(np.where(known, a, np.nan) / np.where(known, b, 1.0))


def _power(anomaly: Float[np.ndarray, "y x"]):
    """Octaves of wavelength, from half of the image to two pixels, and their power."""
    shape = anomaly.shape
    window = np.hanning(shape[0])[:, None] * np.hanning(shape[1])
    spectrum = np.fft.rfft2(anomaly * window.astype(np.float32))
    # Both halves of the plane: all columns but the first, and the last of an even
    # number, stand for two.
    twice = np.full(spectrum.shape[1], 2.0)
    twice[0] = 1.0
    if shape[1] % 2 == 0:
        twice[-1] = 1.0
    power = np.abs(spectrum) ** 2 * twice
    frequency = np.hypot(np.fft.fftfreq(shape[0])[:, None], np.fft.rfftfreq(shape[1]))
    count = int(np.log2(max(min(shape), 2) / SHORTEST_WAVELENGTH))
    longest = SHORTEST_WAVELENGTH * 2.0 ** np.arange(count, 0, -1)
    octave = np.digitize(frequency, np.append(1 / longest, 1 / SHORTEST_WAVELENGTH)) - 1
    inside = (octave >= 0) & (octave < count)

    def total(weights):
        found = np.broadcast_to(weights, octave.shape)[inside]
        return np.bincount(octave[inside], weights=found, minlength=count)

    number = np.maximum(total(twice), 1.0)
    # Of a component: the sum over all of them is the variance under the window.
    return longest, total(power) / number / (shape[0] * shape[1] * (window**2).sum())
