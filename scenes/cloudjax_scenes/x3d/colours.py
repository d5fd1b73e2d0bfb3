"""Colours of boards and of the ground, from the renderer's radiances."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8
from scipy.ndimage import gaussian_filter

from .seen_cloud import SeenCloud


# Pixels with less cloud have the colour of those about them.
_LEAST_OPACITY = 0.05
# Widths [pixels] over which colours are carried into clear pixels.
_CARRIED = (1.0, 4.0, 16.0, 64.0)
_BLUE, _RED, _NEAR_INFRARED = 1, 2, 3


@dataclass(frozen=True)
class Exposure:
    """An `Exposure` turns reflectance factors into bytes of a screen.

    **Fields:** `white`: the reflectance factor that is white.
    """

    white: float

    @classmethod
    def of_sun(cls, height: float) -> "Exposure":
        """Make that for a sun: white sends back all of its light.

        **Arguments:** `height`: sine of the sun's elevation.
        """
        return cls(max(height, 0.1))

    def screen(
        self, numbers: Sequence[int], reflectance: Float[np.ndarray, "bands rays"]
    ) -> Float[np.ndarray, "rays 3"]:
        """Return red, green and blue, as screens take them, 0 to 1 and beyond.

        **Arguments:** `numbers`: of the bands. What is missing of ABI's bands 1, 2 and
        3 is grey.
        """
        known = dict(zip(numbers, reflectance, strict=True))
        some = next(iter(known.values()))
        red = known.get(_RED, known.get(_NEAR_INFRARED, some))
        blue = known.get(_BLUE, red)
        infrared = known.get(_NEAR_INFRARED, red)
        # ABI has no green: vegetation's is told from the near infrared.
        green = 0.45 * red + 0.1 * infrared + 0.45 * blue
        linear = np.stack([red, green, blue], axis=-1) / self.white
        low, high = (
            12.92 * linear,
            1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055,
        )
        return np.where(linear <= 0.0031308, low, high)


def cloud_colours(
    seen: SeenCloud, numbers: Sequence[int], exposure: Exposure
) -> UInt8[np.ndarray, "rows columns 3"]:
    """Find the colour that cloud must have, to look over the ground as rendered.

    A board of opacity a over the ground shows a c + (1 - a) g, in bytes of the screen;
    c follows from what the renderer sees with and without cloud.
    """
    shape = (*seen.picture.shape, 3)
    cloudy, clear = (
        np.clip(exposure.screen(numbers, x), 0, 1) for x in (seen.cloudy, seen.clear)
    )
    opacity = seen.opacity[:, None]
    colour = (cloudy - (1 - opacity) * clear) / np.maximum(opacity, 1e-6)
    sure = np.where(opacity > _LEAST_OPACITY, opacity, 0) ** 2
    colour = np.where(sure > 0, np.clip(colour, 0, 1), 0).reshape(shape)
    return as_bytes(_carried(colour, sure.reshape(*shape[:2], 1)))


def ground_colours(
    seen: SeenCloud, numbers: Sequence[int], exposure: Exposure
) -> UInt8[np.ndarray, "rows columns 3"]:
    """Return the colour of the ground without cloud."""
    return as_bytes(exposure.screen(numbers, seen.clear)).reshape(
        *seen.picture.shape, 3
    )


def as_bytes(colour: Float[np.ndarray, "*shape"]) -> UInt8[np.ndarray, "*shape"]:
    """Return colours of 0 to 1 as bytes."""
    return np.rint(np.clip(colour, 0, 1) * 255).astype(np.uint8)


def _carried(colour, sure):
    """Colours where they are sure, and elsewhere means of those about."""
    found, known = colour, np.minimum(sure / _LEAST_OPACITY, 1)
    for width in _CARRIED:
        sigma = (width, width, 0)
        weight = gaussian_filter(sure, sigma)
        mean = gaussian_filter(colour * sure, sigma) / np.maximum(weight, 1e-12)
        reached = np.minimum(weight / 1e-6, 1)
        found = known * found + (1 - known) * mean
        known = known + (1 - known) * reached
    anywhere = (colour * sure).sum((0, 1)) / max(sure.sum(), 1e-12)
    return known * found + (1 - known) * anywhere
