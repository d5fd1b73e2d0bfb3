"""Temperature and pressure of clear air depend on altitude here.

The US Standard Atmosphere 1976 (NOAA-S/T 76-1562, table 4 and equations 18, 23, 33),
and profiles from a weather analysis, both as callables from altitude to temperature.
"""

import abc
import functools as ft
import operator as op

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Float


# The constants of the standard itself, which differ from today's CODATA values.
GEOPOTENTIAL_RADIUS_M = 6_356_766.0  # r₀, effective: of no use but for geopotential
GRAVITY_M_S2 = 9.80665
GAS_CONSTANT_J_KG_K = 8314.32 / 28.9644  # dry air
SEA_LEVEL_TEMPERATURE_K = 288.15
SEA_LEVEL_PRESSURE_PA = 101_325.0

# (thickness m', lapse rate K/m') from sea level up, in geopotential metres
_LAYERS = (
    (11_000.0, -6.5e-3),
    (9_000.0, 0.0),
    (12_000.0, 1.0e-3),
    (15_000.0, 2.8e-3),
    (4_000.0, 0.0),
    (20_000.0, -2.8e-3),
    (13_852.0, -2.0e-3),
)
_LOWEST_M = -5_000.0


def _geopotential_m(altitude_m):
    """H = r₀z/(r₀ + z), held at the ends of the standard: -5 and 84.852 km."""
    # Clipped first: far below the ground r₀ + z would vanish. As an array of JAX: its
    # compiled functions take those of numpy for the precision of an earlier call.
    z = jnp.clip(jnp.asarray(altitude_m), -5_100.0, 87_000.0)
    r0 = GEOPOTENTIAL_RADIUS_M
    highest = sum(thickness for thickness, _ in _LAYERS)
    return jnp.clip(r0 * z / (r0 + z), _LOWEST_M, highest)


def _segments(altitude_m):
    """Height climbed within each layer, the layer's lapse rate and base temperature.

    The sum over all layers with clipped heights replaces a search for the right one.
    """
    height, base_m, base_k = _geopotential_m(altitude_m), 0.0, SEA_LEVEL_TEMPERATURE_K
    for thickness, lapse in _LAYERS:
        lowest = _LOWEST_M if base_m == 0 else 0.0
        yield jnp.clip(height - base_m, lowest, thickness), lapse, base_k
        base_m, base_k = base_m + thickness, base_k + lapse * thickness


def temperature_k(altitude_m: Float[ArrayLike, "*points"]) -> Float[Array, "*points"]:
    """Return the temperature [K] of the US Standard Atmosphere 1976 at altitudes [m].

    It is differentiable but for kinks between layers (11, 20, 32, 47, 51, 71 km').
    Outside -5 km to 86 km the value at the end is held.
    """
    warmer = [lapse * height for height, lapse, _ in _segments(altitude_m)]
    return ft.reduce(op.add, warmer) + SEA_LEVEL_TEMPERATURE_K


def pressure_pa(altitude_m: Float[ArrayLike, "*points"]) -> Float[Array, "*points"]:
    """Return the pressure [Pa] of the US Standard Atmosphere 1976 at altitudes [m].

    It is hydrostatic: equations (33a) and (33b) of the standard. Outside -5 km to 86 km
    the value at the end is held.
    """
    # ∫dH/T; log1p stays accurate at the base of each layer
    paths = [
        jnp.log1p(lapse * height / base_k) / lapse if lapse else height / base_k
        for height, lapse, base_k in _segments(altitude_m)
    ]
    scale_heights = GRAVITY_M_S2 / GAS_CONSTANT_J_KG_K * ft.reduce(op.add, paths)
    return SEA_LEVEL_PRESSURE_PA * jnp.exp(-scale_heights)


class AbstractTemperature(eqx.Module):
    """A temperature of the air is a function of altitude."""

    @abc.abstractmethod
    def __call__(
        self, altitude_m: Float[ArrayLike, "*points"]
    ) -> Float[Array, "*points"]:
        """Return the temperature [K] at geometric altitudes [m]."""

    def at(
        self,
        latitude_deg: Float[np.ndarray, " points"],
        longitude_deg: Float[np.ndarray, " points"],
        altitude_m: Float[np.ndarray, " points"],
    ) -> Float[np.ndarray, " points"] | None:
        """Return the temperature [K] at places, on the host, or None if it is
        everywhere the same at an altitude.
        """
        return None


class StandardAtmosphere(AbstractTemperature):
    """The air is `offset_k` kelvin warmer than `temperature_k` says, everywhere."""

    offset_k: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=0.0)

    def __call__(
        self, altitude_m: Float[ArrayLike, "*points"]
    ) -> Float[Array, "*points"]:
        """Return the temperature [K] at geometric altitudes [m]."""
        return temperature_k(altitude_m) + self.offset_k


class TemperatureProfile(AbstractTemperature):
    """The temperature is linear between levels, such as one column of an analysis.

    - `altitude_m`: [level] strictly ascending, at least two.
    - `temperature_k`: [level].
    - `offset_k`: added at every altitude.

    Outside the levels the value of the nearest one is held.
    """

    altitude_m: Float[Array, " level"] = eqx.field(converter=jnp.asarray)
    temperature_k: Float[Array, " level"] = eqx.field(converter=jnp.asarray)
    offset_k: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=0.0)

    def __check_init__(self):
        levels = self.altitude_m.size
        if levels < 2 or levels != self.temperature_k.size:
            raise ValueError(
                "altitude_m and temperature_k must have the same two levels or more; "
                f"they have {levels} and {self.temperature_k.size}."
            )
        if isinstance(self.altitude_m, Tracer):
            return
        # written so that NaN fails
        if not jnp.all(jnp.diff(self.altitude_m) > 0):
            raise ValueError(
                "altitude_m must ascend strictly and hold no NaN; analyses are often "
                "stored from the top down: reverse both arrays."
            )

    def __call__(
        self, altitude_m: Float[ArrayLike, "*points"]
    ) -> Float[Array, "*points"]:
        """Return the temperature [K] at geometric altitudes [m]."""
        profile = jnp.interp(
            jnp.asarray(altitude_m), self.altitude_m, self.temperature_k
        )
        return profile + self.offset_k
