"""Water vapour follows from the humidity that analyses give."""

import numpy as np
from jaxtyping import Float


# Molar mass of water over that of dry air.
_LIGHTNESS = 18.015 / 28.9644
# Ice alone below, water alone above: as the GFS and the IFS mix them.
_ICE_K, _WATER_K = 250.16, 273.16


def saturation_hpa(
    temperature_k: Float[np.ndarray, "*n"],
) -> Float[np.ndarray, "*n"]:
    """Return the saturation pressure of vapour [hPa], over water or, in the cold, over
    ice.

    Alduchov & Eskridge (1996, J. Appl. Meteorol. 35, 601, eqs. 21 and 23), mixed by the
    square of the temperature in between (IFS documentation Cy47r3, part IV, eq. 7.93).
    """
    celsius = temperature_k - 273.15
    water = 6.1094 * np.exp(17.625 * celsius / (243.04 + celsius))
    ice = 6.1121 * np.exp(22.587 * celsius / (273.86 + celsius))
    share = np.clip((temperature_k - _ICE_K) / (_WATER_K - _ICE_K), 0, 1) ** 2
    return share * water + (1 - share) * ice


def specific_humidity(
    relative_percent: Float[np.ndarray, "*n"],
    temperature_k: Float[np.ndarray, "*n"],
    pressure_hpa: Float[np.ndarray, "*#n"],
) -> Float[np.ndarray, "*n"]:
    """Return the mass of vapour over that of moist air, q = ε e/(p - (1 - ε) e).

    Humidities outside of 0 to 100 % are brought back; NaN stays.
    """
    e = np.clip(relative_percent, 0, 100) / 100 * saturation_hpa(temperature_k)
    # Where air is so thin that vapour would outweigh it, nothing is known.
    e = np.minimum(e, 0.1 * pressure_hpa)
    return _LIGHTNESS * e / (pressure_hpa - (1 - _LIGHTNESS) * e)
