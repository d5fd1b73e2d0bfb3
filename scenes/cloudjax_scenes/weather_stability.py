"""How stable the air of an analysis is: inversions and the tropopause."""

import numpy as np
from jaxtyping import Bool, Float

from cloudjax_data import WeatherCube
from cloudjax_data.humidity import specific_humidity


Field = Float[np.ndarray, "lat lon"]

_KAPPA = 287.05 / 1004.7
# Of dry air and of vapour [J/kg/K], heat capacity, latent heat [J/kg], gravity.
_RA, _RV, _CP, _LATENT, _GRAVITY = 287.05, 461.5, 1004.7, 2.5e6, 9.81
# Way up by which a kelvin of dew point depression lifts the condensation level [m].
_LIFT_M_PER_K = 125.0
# WMO (1957): the tropopause is where the lapse rate falls to 2 K/km.
_TROPOPAUSE_K_M = 2e-3
_LOWEST_TROPOPAUSE_HPA = 500.0
# Inversions of the boundary layer are below.
_INVERSIONS_HPA = 700.0


def inversion_strength_k(cube: WeatherCube) -> Field:
    """Return the estimated inversion strength, Wood & Bretherton (2006, J. Clim. 19,
    6425, eq. 4): θ_700 - θ_1000 - Γ_850 (z_700 - z_LCL).
    """
    (t1000, r1000, _), (t850, _, _), (t700, _, z700) = (
        _level(cube, hpa) for hpa in (1000.0, 850.0, 700.0)
    )
    static = t700 * (1000 / 700) ** _KAPPA - t1000
    saturated = specific_humidity(
        np.full_like(t850, 100.0), t850, np.full((1, 1), 850.0)
    )
    moist = (1 + _LATENT * saturated / (_RA * t850)) / (
        1 + _LATENT**2 * saturated / (_CP * _RV * t850**2)
    )
    lapse = _GRAVITY / _CP * (1 - moist)
    condensation_m = _LIFT_M_PER_K * _dew_point_depression_k(t1000, r1000)
    return np.nan_to_num(static - lapse * (z700 - condensation_m))


def most_stable(
    cube: WeatherCube, above_ground: Bool[np.ndarray, "level lat lon"]
) -> tuple[Field, Field]:
    """Return -dθ/dp [K/hPa] of the most stable layer of low levels, and the relative
    humidity, 0 to 1, at its base.
    """
    pressure = cube.data["level"].to_numpy().astype(float)[:, None, None]
    kelvin, humidity = (cube.data[n].to_numpy().astype(float) for n in ("t", "r"))
    potential = kelvin * (1000 / pressure) ** _KAPPA
    rise = np.diff(potential, axis=0) / -np.diff(pressure, axis=0)
    counts = above_ground[:-1] & (pressure[1:] >= _INVERSIONS_HPA) & np.isfinite(rise)
    rise = np.where(counts, rise, -1.0)
    at = rise.argmax(axis=0)[None]
    base = np.take_along_axis(humidity[:-1], at, axis=0)[0]
    return np.take_along_axis(rise, at, axis=0)[0], np.nan_to_num(base) / 100


def tropopause_m(cube: WeatherCube) -> tuple[Field, str]:
    """Return its height [m], and what that is taken from."""
    if "tropopause_gpm" in cube.data:
        height = cube.data["tropopause_gpm"].to_numpy().astype(float)
        return np.nan_to_num(height), "the file's tropopause"
    height, kelvin = (cube.data[n].to_numpy().astype(float) for n in ("gh", "t"))
    lapse = -np.diff(kelvin, axis=0) / np.diff(height, axis=0)
    high = cube.data["level"].to_numpy()[:-1, None, None] <= _LOWEST_TROPOPAUSE_HPA
    stable = high & (lapse < _TROPOPAUSE_K_M)
    # Where none is found it is at the highest level.
    first = np.where(stable.any(axis=0), stable.argmax(axis=0), len(height) - 1)
    found = np.take_along_axis(height, first[None], axis=0)[0]
    return np.nan_to_num(found), "lapse rates below 2 K/km"


def _level(cube: WeatherCube, hpa: float) -> tuple[Field, Field, Field]:
    """Temperature, relative humidity and height of the level next to a pressure."""
    at = int(np.argmin(np.abs(cube.data["level"].to_numpy() - hpa)))
    t, r, z = (cube.data[n].to_numpy()[at].astype(float) for n in ("t", "r", "gh"))
    return t, r, z


def _dew_point_depression_k(kelvin: Field, humidity: Field) -> Field:
    """By the formula of Magnus."""
    celsius = kelvin - 273.15
    γ = np.log(np.clip(humidity, 1, 100) / 100) + 17.625 * celsius / (243.04 + celsius)
    return celsius - 243.04 * γ / (17.625 - γ)
