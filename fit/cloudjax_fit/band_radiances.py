"""Radiances of one band, with what is known of their place, time and meaning."""

from dataclasses import dataclass
from datetime import datetime

import numpy as np
from jaxtyping import Float, Num

from cloudjax import Band, FixedGrid
from cloudjax_data import earth_sun_distance_au
from cloudjax_scenes.band_image import BandImage
from cloudjax_scenes.quantity import RADIANCE, Quantity


@dataclass(frozen=True, eq=False)
class BandRadiances:
    """`BandRadiances` are of one ABI band, in `units`, NaN where there is none.

    Or another `quantity`, where a file has no radiances.

    **Fields:**

    - `values`: an image `[y, x]`, or pixels without places `[n]`.
    - `grid`: of an image, where it is known.
    - `time`: in UTC, where it is known.
    - `band`: what radiance means in it, where that is known.
    """

    number: int
    units: str
    values: Num[np.ndarray, "_ _"] | Num[np.ndarray, " _"]
    quantity: Quantity = RADIANCE
    grid: FixedGrid | None = None
    time: datetime | None = None
    band: Band | None = None

    def pixels(self) -> Float[np.ndarray, " n"]:
        """Return the finite radiances, without their places, in float64."""
        values = np.asarray(self.values, np.float64).ravel()
        return values[np.isfinite(values)]

    def image(self) -> Num[np.ndarray, "_ _"] | None:
        """Return the image, or None for pixels without places."""
        return self.values if self.values.ndim == 2 else None

    @property
    def is_known(self) -> bool:
        """Tell whether it is known what the radiances mean, so that `shown` is there.

        Sunlight is of a date; emission is not.
        """
        if self.quantity is not RADIANCE:
            return True
        dated = self.time is not None
        return self.band is not None and (dated or not self.band.reflective)

    def shown(self) -> Float[np.ndarray, "*pixels"]:
        """Return reflectance factors, or brightness temperatures in kelvin.

        **Raises:** `ValueError` where it is not known what the radiances mean.
        """
        values = np.asarray(self.values, np.float64)
        if self.quantity is not RADIANCE:
            return values
        if self.band is None or not self.is_known:
            raise ValueError(f"What radiances of band {self.number} mean is not known.")
        distance = 1.0 if self.time is None else earth_sun_distance_au(self.time)
        return BandImage(self.band, self.band.coefficients(distance), values).shown
