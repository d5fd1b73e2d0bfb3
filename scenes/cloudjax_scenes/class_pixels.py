"""Which pixels of an image show which class of cloud."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from cloudjax import CloudClass
from cloudjax.air.atmosphere import temperature_k
from cloudjax.clouds.classes import ImageryRule
from cloudjax_data import DataError


@dataclass(frozen=True, eq=False)
class Shown:
    """What tells the pixels of an image apart.

    **Fields:**

    - `good`: those that are known; `cloud`: those of them that are cloud by the rule.
    - `thin`: those of them that are neither cloud nor surely clear.
    - `reflectance`: in the band that tells cloud by day; None where none does.
    - `window_k`: brightness temperature in the window; None where none is seen.
    """

    good: Bool[np.ndarray, "y x"]
    cloud: Bool[np.ndarray, "y x"]
    thin: Bool[np.ndarray, "y x"]
    reflectance: Float[np.ndarray, "y x"] | None
    window_k: Float[np.ndarray, "y x"] | None


@dataclass(frozen=True, eq=False)
class ClassPixels:
    """`ClassPixels` are the pixels of a class of cloud.

    **Fields:** `own`: those that show it; `seen`: those that would if it were there.
    """

    own: Bool[np.ndarray, "y x"]
    seen: Bool[np.ndarray, "y x"]


def tell_classes(
    shown: Shown, classes: Mapping[str, CloudClass]
) -> dict[str, ClassPixels]:
    """Tell the cloud pixels into those classes that the image shows, by name.

    **Raises:** `DataError` if none of the classes takes a pixel.
    """
    found = {}
    for name, one in classes.items():
        pixels = None if one.imagery is None else _pixels(shown, one.imagery)
        if pixels is not None and pixels.own.any():
            found[name] = pixels
    if not found:
        raise DataError(
            f"None of the classes {', '.join(classes)} takes a cloud pixel of the "
            "scene: give one of them a table imagery whose conditions the clouds meet."
        )
    return found


def _pixels(shown: Shown, rule: ImageryRule) -> ClassPixels | None:
    """The pixels of one class; None where the image cannot tell it."""
    own, seen = shown.cloud, shown.good
    window_k, reflectance = shown.window_k, shown.reflectance
    if rule.darker_than is not None:
        # Unseen by the sun clouds are taken for opaque, as their tops are.
        if reflectance is None:
            return None
        own = own & (reflectance <= rule.darker_than)
    if rule.brighter_than is not None and reflectance is not None:
        own = own & (reflectance > rule.brighter_than)
    if rule.colder_than_standard_at_m is not None:
        if window_k is None:
            return None
        own = own & (window_k < _standard_k(rule.colder_than_standard_at_m))
    else:
        # What is thin and warm is of the clouds that need not be cold.
        own = own | shown.thin
    if rule.warmer_than_standard_at_m is not None and window_k is not None:
        cold = window_k < _standard_k(rule.warmer_than_standard_at_m)
        hidden = shown.cloud & cold
        own, seen = own & ~cold, seen & ~hidden
    return ClassPixels(own, seen)


def _standard_k(altitude_m: float) -> float:
    return float(temperature_k(altitude_m))
