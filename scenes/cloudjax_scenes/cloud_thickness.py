"""How thick a cloud is, and of what, by its optical depth and the air at its top.

- Phase: ice where the top is colder than 260 K, water else, with effective radii of 30
  and 10 µm, as the International Satellite Cloud Climatology Project takes them (Rossow
  & Schiffer 1999, Bull. Amer. Meteor. Soc. 80, 2261).
- Thickness: of water 0.39 ln τ - 0.01 km, of ice 7.2 - 0.024 T + 0.95 ln τ km, T being
  the cloud's temperature in kelvin (Smith et al. 1993 and Chakrapani et al. 2002, as
  the retrievals of CERES take them: Minnis et al. 2011, IEEE TGRS 49, 4374). They are
  regressions; here T is the top's, and both are held above 100 m and the ground.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from cloudjax.air.atmosphere import temperature_k


FREEZING_TOP_K = 260.0
# The thinnest cloud [m].
LEAST_M = 100.0
_LEAST_DEPTH = 1e-3


@dataclass(frozen=True)
class CloudKind:
    """A `CloudKind` is cloud of one phase.

    **Fields:** `phase`: "water" or "ice"; `effective_radius_um`: the usual one;
    `constant_km`, `per_kelvin_km`, `per_log_km`: thickness [km] = constant + per kelvin
    times T + per log times ln τ.
    """

    phase: str
    effective_radius_um: float
    constant_km: float
    per_kelvin_km: float
    per_log_km: float

    def thickness_m(
        self, optical_depth: Float[np.ndarray, "*n"], top_m: Float[np.ndarray, "*n"]
    ) -> Float[np.ndarray, "*n"]:
        """Return thicknesses [m] of at least 100 m, and less than the tops are high.

        **Arguments:** `top_m`: above the ground.
        """
        km = (
            self.constant_km
            + self.per_kelvin_km * standard_k(top_m)
            + self.per_log_km * np.log(np.maximum(optical_depth, _LEAST_DEPTH))
        )
        return np.minimum(np.maximum(1e3 * km, LEAST_M), np.maximum(top_m, LEAST_M))


WATER = CloudKind("water", 10.0, -0.01, 0.0, 0.39)
ICE = CloudKind("ice", 30.0, 7.2, -0.024, 0.95)


def standard_k(height_m: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """Return the temperature [K] of the US Standard Atmosphere, on the host."""
    return np.asarray(temperature_k(height_m), float)


def is_ice(top_m: Float[np.ndarray, "*n"]) -> Bool[np.ndarray, "*n"]:
    """Tell which clouds are of ice, by the temperature of their tops."""
    return standard_k(top_m) < FREEZING_TOP_K
