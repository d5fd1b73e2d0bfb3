"""Water and ice of a weather model, how large their particles are, and their air."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


# Of pure water and ice [kg/m³].
_DENSITY = {"water": 1000.0, "ice": 890.0}


@dataclass(frozen=True)
class Species:
    """A `Species` is one kind of condensate that WRF keeps apart.

    **Fields:**

    - `phase`: "water" or "ice".
    - `content`, `number`, `radius`: names of the variables of its mixing ratio
      [kg/kg], number [1/kg] and effective radius [m].
    - `usual_um`: the effective radius where the file has neither.
    - `widening`: effective radius over that of the mean volume.
    """

    phase: str
    content: str
    number: str
    radius: str
    usual_um: float
    widening: float

    def radius_um(
        self,
        content: Float[np.ndarray, "*n"],
        number: Float[np.ndarray, "*n"] | None,
        radius_m: Float[np.ndarray, "*n"] | None,
    ) -> Float[np.ndarray, "*n"]:
        """Return effective radii [µm], of the file's where it has them.

        Else they follow from mass and number, r = w (3 q / (4π ρ N))^(1/3); where
        there is nothing, they are the usual one.
        """
        if radius_m is not None:
            found = radius_m * 1e6
        elif number is not None:
            volume = content / (_DENSITY[self.phase] * np.maximum(number, 1e-3))
            found = 1e6 * self.widening * np.cbrt(3 * volume / (4 * np.pi))
        else:
            found = np.full_like(content, self.usual_um)
        known = (content > 0) & (found > 0)
        return np.where(known, np.clip(found, *_POSSIBLE_UM), self.usual_um)


_POSSIBLE_UM = (1.0, 5000.0)
# Gamma distributions of droplets with the k = 0.8 of Martin et al. (1994, J. Atmos.
# Sci. 51, 1823), k^(-1/3); exponential ones of what falls and of ice, 3/6^(1/3).
_DROPLETS, _EXPONENTIAL = 0.8 ** (-1 / 3), 3 / 6 ** (1 / 3)
SPECIES = (
    Species("water", "QCLOUD", "QNCLOUD", "RE_CLOUD", 10.0, _DROPLETS),
    Species("water", "QRAIN", "QNRAIN", "RE_RAIN", 500.0, _EXPONENTIAL),
    Species("ice", "QICE", "QNICE", "RE_ICE", 30.0, _EXPONENTIAL),
    Species("ice", "QSNOW", "QNSNOW", "RE_SNOW", 80.0, _EXPONENTIAL),
    Species("ice", "QGRAUP", "QNGRAUPEL", "RE_GRAUPEL", 500.0, _EXPONENTIAL),
)


@dataclass(frozen=True, eq=False)
class Condensate:
    """A `Condensate` is all water, or all ice, of the columns of a model.

    **Fields:**

    - `phase`: "water" or "ice".
    - `content_g_m3`: mass per volume of air, means over the cells.
    - `effective_radius_um`: mean volume over mean projected area, times 3/4.
    """

    phase: str
    content_g_m3: Float[np.ndarray, "levels y x"]
    effective_radius_um: Float[np.ndarray, "levels y x"]


def joined(
    phase: str, parts: list[tuple[Float[np.ndarray, "*n"], Float[np.ndarray, "*n"]]]
) -> Condensate:
    """Join species of one phase: their masses, and their projected areas, add up.

    **Arguments:** `parts`: content [g/m³] and effective radius [µm] of each.
    """
    content = np.sum([mass for mass, _ in parts], axis=0)
    area = np.sum([mass / radius for mass, radius in parts], axis=0)
    usual = parts[0][1]
    some = area > 0
    radius = np.where(some, content / np.where(some, area, 1), usual)
    return Condensate(phase, content, radius)


@dataclass(frozen=True, eq=False)
class LevelAir:
    """A `LevelAir` is air over columns, up to some height.

    **Fields:** `heights_m`: ascending; `temperature_k`, `specific_humidity`: there.
    """

    heights_m: Float[np.ndarray, "levels y x"]
    temperature_k: Float[np.ndarray, "levels y x"]
    specific_humidity: Float[np.ndarray, "levels y x"]
