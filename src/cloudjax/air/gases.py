"""Gases take light away in the ABI bands, above a place and along a slant.

Mean transmittances of whole bands are exp(-τ), with τ smooth, positive and growing with
what is above: it adds up three absorbers on a curve of growth each and the self
continuum of water vapour. tools/make_gases.py makes the table, gases.toml, and
docs/theory/air.md has its error.
"""

import functools as ft
import importlib.resources
import itertools
import tomllib
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from cloudjax.geometry.latlon_grid import AnyArray

from . import atmosphere
from .atmosphere import GAS_CONSTANT_J_KG_K, GEOPOTENTIAL_RADIUS_M, GRAVITY_M_S2


# Between which columns, and what they do to light, are interpolated.
LEVELS_M = 1e3 * np.concatenate(
    [np.arange(0, 4, 0.5), np.arange(4, 13), [14, 16, 20, 25, 30, 40, 50]]
)
# Molar mass of water over that of dry air.
LIGHTNESS = 18.015 / 28.9644
# The self continuum is stronger in the cold as exp(1800 K (1/T - 1/296 K)): Roberts et
# al. (1976, Appl. Opt. 15, 2085).
CONTINUUM_K = 1800.0


class Columns(eqx.Module):
    """Columns count the absorbers above places.

    **Fields:**

    - `pressure`: of the air there, in atm.
    - `water`: vapour above, in g/cm².
    - `continuum`: each gram of it times its own pressure in atm and the strength of the
      cold.
    - `ozone`: above, in atm cm; `ozone_pressure`: its mean pressure, in atm.
    """

    pressure: Float[AnyArray, "*n"]
    water: Float[AnyArray, "*n"]
    continuum: Float[AnyArray, "*n"]
    ozone: Float[AnyArray, "*n"]
    ozone_pressure: Float[AnyArray, "*n"]


def columns(
    temperature_k: Float[AnyArray, "*n levels"],
    specific_humidity: Float[AnyArray, "*n levels"],
) -> Columns:
    """Integrate profiles at `LEVELS_M`, temperature in kelvin and humidity in kg/kg, to
    the columns above each level; numpy in, numpy out.

    Pressure is hydrostatic from 1013.25 hPa at sea level. Precipitable water is
    ∫ q dp/g (Peixoto & Oort 1992, eq. 12.8). Ozone is that of the standard at the same
    pressure.
    """
    q = specific_humidity
    xp = np if isinstance(temperature_k, np.ndarray) else jnp
    virtual = temperature_k * (1 + (1 / LIGHTNESS - 1) * q)
    last_axis = (1,) * (virtual.ndim - 1) + (-1,)
    g = GRAVITY_M_S2 / (1 + LEVELS_M / GEOPOTENTIAL_RADIUS_M) ** 2
    steepness = g.reshape(last_axis) / (GAS_CONSTANT_J_KG_K * virtual)
    fall = _means(steepness) * np.diff(LEVELS_M).reshape(last_axis)
    # A product with ones, also in `_upwards`, is faster than a running sum.
    pressure = xp.exp(-xp.matmul(fall, _BELOW, **_exact(xp)))
    vapour = q * pressure / (LIGHTNESS + (1 - LIGHTNESS) * q)
    cold = xp.exp(CONTINUUM_K * (1 / temperature_k - 1 / 296))
    # 0.1 g/cm² is 1 kg/m²; 1 atm is 101325 Pa.
    gram = -xp.diff(pressure, axis=-1) * 0.1 * 101325 / GRAVITY_M_S2
    ozone, ozone_pressure = _ozone(pressure)
    return Columns(
        pressure,
        _upwards(_means(q) * gram),
        _upwards(_means(q * vapour * cold) * gram),
        ozone,
        ozone_pressure,
    )


def standard_humidity() -> Float[np.ndarray, " levels"]:
    """Return the specific humidity [kg/kg] of the AFGL US standard atmosphere at
    `LEVELS_M`.
    """
    return _table()["standard"]["specific_humidity"]


def airmass(cosine: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """Return the length of a slant over that straight up; it is 40 at the horizon and
    below.

    The formula is Rozenberg's (1966, Twilight), for cosines of zenith angles.
    """
    μ = np.maximum(cosine, 0.0)
    return 1 / (μ + 0.025 * np.exp(-11 * μ))


def optical_depth(
    bands: Sequence[int], above: Columns, airmass: Float[AnyArray, "*#n"]
) -> Float[Array, "bands *n"]:
    """Return the optical depth of the gases along slants to space, by ABI band."""
    rows = np.array(bands, int) - 1
    table = _table()

    def of_bands(coefficients):
        shape = (len(rows),) + (1,) * np.ndim(above.pressure)
        return coefficients[rows].astype(np.float32).reshape(shape)

    slant = jnp.asarray(airmass)[None]
    total = of_bands(table["continuum"][:, 0]) * (slant * above.continuum[None])
    for name, column, pressure in (
        ("dry", above.pressure, above.pressure),
        ("water", above.water, above.pressure),
        ("ozone", above.ozone, above.ozone_pressure),
    ):
        a, s, c, n = (of_bands(values) for values in table[name].T)
        if a.any():
            # Exponentials are much faster than powers. A root has no slope at zero.
            broadened = jnp.exp(n * jnp.log(jnp.maximum(pressure, 1e-6))[None])
            u = slant * column[None] * broadened
            total = total + a * u * jnp.exp(-c * jnp.log1p(s * u))
    return total


def scattering_depth(bands: Sequence[int]) -> Float[np.ndarray, " bands"]:
    """Return the optical depth of Rayleigh scattering straight up from 1013.25 hPa, by
    ABI band.
    """
    return _table()["scattering"][np.array(bands, int) - 1]


def standard_depth(bands: Sequence[int]) -> Float[np.ndarray, " bands"]:
    """Return the optical depth of the gases straight up from sea level in the US
    standard atmosphere, by ABI band.
    """
    # Air may be made where jax traces; which of its gases count is no part of that.
    with jax.ensure_compile_time_eval():
        kelvin = np.asarray(atmosphere.temperature_k(LEVELS_M), float)
        above = columns(kelvin, standard_humidity())
        depth = optical_depth(bands, above, jnp.ones(len(LEVELS_M)))
        return np.asarray(depth, float)[:, 0]


def _means(levels):
    return (levels[..., 1:] + levels[..., :-1]) / 2


# Which layers are below each level.
_BELOW = np.triu(np.ones((len(LEVELS_M) - 1, len(LEVELS_M)), np.float32), 1)


def _upwards(layers):
    """Sums of all layers above each level."""
    xp = np if isinstance(layers, np.ndarray) else jnp
    return xp.matmul(layers, 1 - _BELOW, **_exact(xp))


def _exact(xp) -> dict:
    return {} if xp is np else {"precision": "highest"}


def _ozone(pressure):
    """Ozone above and its mean pressure, linear in pressure between the levels of the
    standard.

    The sum over all its layers of what is climbed in each replaces a search.
    """
    xp = np if isinstance(pressure, np.ndarray) else jnp
    standard = _table()["standard"]
    nodes = standard["pressure_atm"][::-1].tolist()
    fields = [standard[name][::-1] for name in ("ozone_atm_cm", "ozone_pressure_atm")]
    found: list[Any] = [float(values[0]) for values in fields]
    slopes = [(np.diff(values) / np.diff(nodes)).tolist() for values in fields]
    for i, (low, high) in enumerate(itertools.pairwise(nodes)):
        climbed = xp.clip(pressure - low, 0, high - low)
        found = [
            total + slope[i] * climbed
            for total, slope in zip(found, slopes, strict=True)
        ]
    return found


@ft.cache
def _table() -> dict:
    file = importlib.resources.files("cloudjax.air").joinpath("gases.toml")
    entries = tomllib.loads(file.read_text(encoding="utf-8"))
    standard = {k: np.array(v) for k, v in entries.pop("standard").items()}
    return {k: np.array(v) for k, v in entries.items()} | {"standard": standard}
