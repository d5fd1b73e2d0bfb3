"""Heights are told from temperatures by the air in which clouds stand."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from cloudjax.air.atmosphere import temperature_k
from cloudjax.air.gases import LEVELS_M
from cloudjax_scenes.model_scene import ModelWorld


@dataclass(frozen=True, eq=False)
class AirColumn:
    """An `AirColumn` is the temperature of air by height, up to the tropopause.

    **Fields:** `heights_m`: ascending; `words`: whose air it is.
    """

    heights_m: Float[np.ndarray, " levels"]
    temperature_k: Float[np.ndarray, " levels"]
    words: str

    def height_m(self, kelvin: float) -> float:
        """Return the lowest height that is so cold [m], NaN for NaN.

        Warmer than the ground it is that of the ground, and colder than the air is
        anywhere, that of the coldest.
        """
        if np.isnan(kelvin):
            return np.nan
        top = int(np.argmin(self.temperature_k)) + 1
        # Where air grows warmer with height, what is below it is as cold already.
        falling = np.minimum.accumulate(self.temperature_k[:top])
        return float(np.interp(-kelvin, -falling, self.heights_m[:top]))


def standard_air() -> AirColumn:
    """Return that of the US standard atmosphere of 1976."""
    kelvin = np.asarray(temperature_k(LEVELS_M), float)
    return AirColumn(LEVELS_M, kelvin, "the US standard atmosphere")


def model_air(world: ModelWorld) -> AirColumn:
    """Return the mean air of a weather model."""
    if world.profiles is None:
        return standard_air()
    kelvin = np.asarray(world.profiles.temperature_k, float).mean(axis=(0, 1))
    return AirColumn(LEVELS_M, kelvin, "the mean air of the model")
