"""Cloud particles absorb and scatter light in the ABI bands, by phase and effective
radius.

Values are means over each band's spectral response, smooth in radius, from Mie theory
for droplets and the fits of Fu (1996) and Fu et al. (1998) for crystals. The table,
cloud_optics.toml, is made by tools/make_optics.py; docs/theory/optics.md compares it
with published values.
"""

import functools as ft
import importlib.resources
import tomllib
from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float


# That optical depths are given at, 0.64 µm, and that thermal absorption is relative to.
REFERENCE_BAND = 2
WINDOW_BAND = 13
# Of the table: sunlight in bands 1 to 7, then emission in bands 7 to 16.
LAST_SUNLIT_BAND = FIRST_THERMAL_BAND = 7


class _Table(NamedTuple):
    """Chebyshev coefficients in log r of log k, log(1 - ω) and g, and r's limits."""

    coefficients: Float[np.ndarray, "degrees quantities rows"]
    limits_um: tuple[float, float]


class Particles(eqx.Module):
    """`Particles` of cloud have one phase and one effective radius.

    Bands are ABI numbers. What belongs to sunlight is averaged with the solar spectrum
    (bands 1 to 7), what belongs to emission with Planck's at cloud temperature (7 to
    16). Beyond the table's radii the values at its ends hold.

    **Fields:**

    - `phase`: "water" (2 to 65 µm) or "ice" (9.32 to 65.1 µm).
    - `effective_radius_um`: mean volume over mean projected area, times 3/4.
    """

    phase: str = eqx.field(static=True)
    effective_radius_um: Float[Array, ""] | float

    def extinction_in(self, bands: Sequence[int]) -> Float[Array, " bands"]:
        """Return the extinction per mass of condensate [m²/g]; in band 7 it is that of
        sunlight.
        """
        return jnp.exp(self._rows(0, [_sunlit(band) for band in bands]))

    def relative_extinction_in(self, bands: Sequence[int]) -> Float[Array, " bands"]:
        """Return the extinction relative to that at 0.64 µm (band 2)."""
        return self.extinction_in(bands) / self.extinction_in([REFERENCE_BAND])

    def co_albedo_in(self, bands: Sequence[int]) -> Float[Array, " bands"]:
        """Return 1 - ω of sunlight."""
        return jnp.exp(self._rows(1, [_sunlit(band) for band in bands]))

    def asymmetry_in(self, bands: Sequence[int]) -> Float[Array, " bands"]:
        """Return the mean cosine of the scattering angle of sunlight."""
        return self._rows(2, [_sunlit(band) for band in bands])

    def thermal_co_albedo_in(self, bands: Sequence[int]) -> Float[Array, " bands"]:
        """Return 1 - ω of thermal radiation; bands 7 to 16."""
        return jnp.exp(self._rows(1, [_thermal(band) for band in bands]))

    def thermal_asymmetry_in(self, bands: Sequence[int]) -> Float[Array, " bands"]:
        """Return the mean cosine of the scattering angle of thermal radiation; bands 7
        to 16.
        """
        return self._rows(2, [_thermal(band) for band in bands])

    def effective_absorption_in(self, bands: Sequence[int]) -> Float[Array, " bands"]:
        """Return the absorption [m²/g] of a pure absorber in place of the cloud: see
        `effective_share`.
        """
        rows = [_thermal(band) for band in bands]
        share = effective_share(
            self.thermal_co_albedo_in(bands), self.thermal_asymmetry_in(bands)
        )
        return jnp.exp(self._rows(0, rows)) * share

    def relative_absorption_in(self, bands: Sequence[int]) -> Float[Array, " bands"]:
        """Return the effective absorption of thermal radiation relative to that at
        10.35 µm (band 13).
        """
        window = self.effective_absorption_in([WINDOW_BAND])
        return self.effective_absorption_in(bands) / window

    @property
    def infrared_ratio(self) -> Float[Array, ""]:
        """Give the effective absorption at 10.35 µm over the extinction at 0.64 µm."""
        window = self.effective_absorption_in([WINDOW_BAND])
        return (window / self.extinction_in([REFERENCE_BAND]))[0]

    def water_content_g_m3(
        self, extinction_per_m: Float[Array, "*n"]
    ) -> Float[Array, "*n"]:
        """Return the condensate [g/m³] that has this extinction [1/m] at 0.64 µm."""
        return extinction_per_m / self.extinction_in([REFERENCE_BAND])[0]

    def _rows(self, quantity: int, rows: list[int]):
        table = _table(self.phase)
        low, high = np.log(table.limits_um)
        log_radius = jnp.log(jnp.asarray(self.effective_radius_um, float))
        # Just within the ends, where arccos has no slope.
        x = jnp.clip(2 * (log_radius - low) / (high - low) - 1, -1 + 1e-6, 1 - 1e-6)
        polynomials = jnp.cos(np.arange(len(table.coefficients)) * jnp.arccos(x))
        coefficients = table.coefficients[:, quantity, np.array(rows, int)]
        return polynomials @ jnp.asarray(coefficients, float)


def effective_share(
    co_albedo: Float[Array, "*bands"], asymmetry: Float[Array, "*bands"]
) -> Float[Array, "*bands"]:
    """Return the share of extinction that a pure absorber needs to stand for a cloud.

    1 - ω (1 - b): what is scattered back, the share b of all that is scattered, is lost
    to the line of sight as well (Chou et al. 1999, J. Climate 12, 159, eqs 8 and 11).
    """
    backward = 0.5 - asymmetry * (0.3738 + asymmetry * (0.0076 + 0.1186 * asymmetry))
    return 1 - (1 - co_albedo) * (1 - backward)


def water(effective_radius_um: Float[Array, ""] | float) -> Particles:
    """Make droplets with a gamma distribution of effective variance 0.1."""
    return Particles("water", effective_radius_um)


def ice(effective_radius_um: Float[Array, ""] | float) -> Particles:
    """Make hexagonal crystals; the effective radius is 3√3/8 of their generalised
    effective size.
    """
    return Particles("ice", effective_radius_um)


WATER = water(10.0)
# A generalised effective size of 60 µm.
ICE = ice(39.0)


def radius_limits_um(phase: str) -> tuple[float, float]:
    """Return the least and the greatest effective radius [µm] that the table has."""
    return _table(phase).limits_um


def _sunlit(band: int) -> int:
    return band - 1 if band <= LAST_SUNLIT_BAND else band


def _thermal(band: int) -> int:
    if band < FIRST_THERMAL_BAND:
        raise ValueError(f"Band {band} sees no emission: ask bands 7 to 16.")
    return band


@ft.cache
def _table(phase: str) -> _Table:
    file = importlib.resources.files("cloudjax.light").joinpath("cloud_optics.toml")
    entry = tomllib.loads(file.read_text(encoding="utf-8"))[phase]
    values = np.array(
        [
            np.log(entry["extinction_m2_per_g"]),
            np.log(entry["co_albedo"]),
            entry["asymmetry"],
        ]
    )
    # Values at the Chebyshev points to coefficients, by the discrete orthogonality.
    points = values.shape[-1]
    angle = np.pi * (np.arange(points)[::-1] + 0.5) / points
    degree = np.arange(points)
    cosines = np.cos(degree[:, None] * angle) * np.where(degree == 0, 1, 2)[:, None]
    coefficients = np.einsum("dp,qrp->dqr", cosines / points, values)
    return _Table(coefficients, tuple(entry["limits_um"]))
