"""What is known of a scene before it is built, by which a front is chosen and read."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cloudjax import Rays


@dataclass(frozen=True)
class Kind:
    """A `Kind` of scenes is what one front serves.

    **Fields:**

    - `source`: of the clouds, such as weather or imagery; `light`: its name.
    - `sunlit`, `thermal`: whether bands are seen that sunlight or emission reaches.
    - `shaded`: whether clouds throw shadows.
    """

    source: str
    light: str
    sunlit: bool
    thermal: bool
    shaded: bool

    def __str__(self) -> str:
        named = {"sunlit": self.sunlit, "thermal": self.thermal, "shaded": self.shaded}
        seen = " ".join(name for name, is_so in named.items() if is_so)
        return f"{self.source} in {self.light} light, {seen}"

    def serves(self, other: "Kind") -> bool:
        """Whether what was measured of this kind tells of the other."""
        same = (self.source, self.light) == (other.source, other.light)
        seen = self.sunlit >= other.sunlit and self.thermal >= other.thermal
        # Shadows are of sunlight alone.
        return same and seen and (self.shaded == other.shaded or not other.sunlit)


@dataclass(frozen=True)
class Outline:
    """An `Outline` is what is known of a scene before it is built.

    **Fields:**

    - `bands`: ABI numbers.
    - `pixel_m`: width of a usual pixel where it meets the ground, or is nearest to it.
    - `pixels`: that are rendered.
    """

    kind: Kind
    bands: tuple[int, ...]
    pixel_m: float
    pixels: int


def usual_pixel_m(rays: Rays) -> float:
    """Return the median width of pixels on the ground; nearest to it where none is."""
    widths = rays.footprint_m()
    if np.isnan(widths).all():
        widths = rays.pixel_rad * rays.ground()[0].distance_m
    return float(np.nanmedian(widths))


def kind_of(
    source: str, light: str, bands: Sequence, *, day: bool, shadows: int
) -> Kind:
    """Tell the kind of a scene.

    **Arguments:** `day`: whether the sun reaches what is seen; `shadows`: steps.
    """
    sunlit = any(band.reflective or (day and band.sunlit) for band in bands)
    thermal = any(not band.reflective for band in bands)
    return Kind(source, light, sunlit, thermal, sunlit and shadows > 0)
