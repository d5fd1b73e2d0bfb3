"""Bands turn reflected sunlight and emission into radiance, in the units of files.

Reflective bands are in W m⁻² sr⁻¹ µm⁻¹, emissive ones in mW m⁻² sr⁻¹ (cm⁻¹)⁻¹, as in
ABI L1b files, whose own coefficients are the fields here. Band 7 reflects and emits:
both parts are in the units of its file, those of emission.
"""

import functools as ft
import importlib.resources
import math
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from . import planck


REFLECTIVE_UNITS = "W m-2 sr-1 um-1"
EMISSIVE_UNITS = "mW m-2 sr-1 (cm-1)-1"
PLANCK = ("fk1", "fk2", "bc1", "bc2")
# Of bands that only reflect, and of those that emit too: each in its own units.
_SOLAR = ("solar_irradiance_w_m2_um", "solar_irradiance_mw_m2_cm")


@dataclass(frozen=True)
class Band:
    """A `Band` is one band of a sensor, and says what radiance means in it.

    **Fields:**

    - `number`: of the ABI band, 1 to 16, whose optics of cloud and ground it has.
    - `wavelength_um`: central wavelength.
    - `solar_irradiance`: at 1 astronomical unit, in the units of radiance times sr;
      None where the band does not see the sun.
    - `planck`: `fk1`, `fk2`, `bc1`, `bc2`; None where the band does not emit.
    """

    number: int
    wavelength_um: float
    solar_irradiance: float | None = None
    planck: tuple[float, float, float, float] | None = None

    def __post_init__(self):
        if self.solar_irradiance is None and self.planck is None:
            raise ValueError(
                f"Band {self.number} neither reflects nor emits: give it a solar "
                "irradiance or Planck coefficients."
            )

    @property
    def sunlit(self) -> bool:
        """Whether it sees the sun by day."""
        return self.solar_irradiance is not None

    @property
    def reflective(self) -> bool:
        """Whether it is looked at in reflectance: whether it does not emit."""
        return self.planck is None

    @property
    def name(self) -> str:
        """Give the name, such as "C02"."""
        return f"C{self.number:02d}"

    @property
    def units(self) -> str:
        """Give the units of the radiance."""
        return REFLECTIVE_UNITS if self.reflective else EMISSIVE_UNITS

    def coefficients(self, earth_sun_distance_au: float = 1.0) -> dict[str, float]:
        """Return `kappa0` if it is sunlit, `fk1`, `fk2`, `bc1`, `bc2` if it emits."""
        found = {}
        if self.planck is not None:
            found |= dict(zip(PLANCK, self.planck, strict=True))
        if self.solar_irradiance is not None:
            found["kappa0"] = math.pi * earth_sun_distance_au**2 / self.solar_irradiance
        return found


def nominal_bands() -> dict[int, Band]:
    """Return the 16 bands of ABI on GOES-16, by number."""
    return dict(_nominal())


@ft.cache
def _nominal() -> dict[int, Band]:
    file = importlib.resources.files("cloudjax.light").joinpath("nominal_bands.toml")
    tables = tomllib.loads(file.read_text(encoding="utf-8"))
    return {
        int(key): Band(
            int(key),
            table["wavelength_um"],
            next((table[k] for k in _SOLAR if k in table), None),
            tuple(table[k] for k in PLANCK) if PLANCK[0] in table else None,
        )
        for key, table in tables.items()
    }


def bands_named(*names: int | str) -> list[Band]:
    """Return nominal bands by number or name, such as 2, "2" or "C02".

    **Raises:** `ValueError` for a name that no band has.
    """
    known = nominal_bands()
    by_name = {
        key: b for b in known.values() for key in (b.number, b.name, f"{b.number}")
    }
    for name in names:
        if name not in by_name:
            raise ValueError(f"There is no band {name!r}: the bands are C01 to C16.")
    return [by_name[name] for name in names]


def sunlit_and_thermal(
    bands: Sequence[Band], *, day: bool = True
) -> tuple[list[Band], list[Band]]:
    """Return the bands that see the sun, and those that emit; some do both.

    **Arguments:** `day`: whether bands that emit see the sun as well.
    """
    sunlit = [band for band in bands if band.reflective or (day and band.sunlit)]
    return sunlit, [band for band in bands if not band.reflective]


class ReflectiveBands(eqx.Module):
    """`ReflectiveBands` see reflected sunlight.

    **Fields:**

    - `numbers`: of the bands.
    - `reflectance_per_radiance`: κ₀ = π d² / E_sun, E_sun per radiance's own units.
    - `path`: reflectance factor of the air above the cloud.
    - `gain`: transmittance of that air, both ways, and the calibration.
    """

    numbers: tuple[int, ...] = eqx.field(static=True)
    reflectance_per_radiance: Float[Array, " bands"]
    path: Float[Array, " bands"]
    gain: Float[Array, " bands"]

    @classmethod
    def of(
        cls,
        bands: Sequence[Band],
        earth_sun_distance_au: float = 1.0,
        path: Sequence[float] | None = None,
    ) -> "ReflectiveBands | None":
        """Make those of the bands that see the sun; None if none does.

        **Arguments:** `path`: reflectance factor of the air, of each such band; 0 by
        default.
        """
        sunlit = [band for band in bands if band.sunlit]
        if not sunlit:
            return None
        κ0 = [band.coefficients(earth_sun_distance_au)["kappa0"] for band in sunlit]
        return cls(
            numbers=tuple(band.number for band in sunlit),
            reflectance_per_radiance=_row(κ0),
            path=_row(np.zeros(len(sunlit)) if path is None else path),
            gain=jnp.ones(len(sunlit)),
        )

    def radiance(
        self, reflectance: Float[Array, "bands rays"]
    ) -> Float[Array, "bands rays"]:
        """Return the radiance of reflectance factors."""
        return reflectance / self.reflectance_per_radiance[:, None]

    def reflectance(
        self, radiance: Float[Array, "bands rays"]
    ) -> Float[Array, "bands rays"]:
        """Return the reflectance factors of radiances."""
        return radiance * self.reflectance_per_radiance[:, None]


class EmissiveBands(eqx.Module):
    """`EmissiveBands` see thermal emission.

    **Fields:**

    - `numbers`: of the bands.
    - `fk1`, `fk2`, `bc1`, `bc2`: the file's Planck function with its band correction,
      L = fk1 / (exp(fk2 / (bc1 + bc2 T)) - 1).
    - `path`: radiance of the air above the cloud.
    - `gain`: transmittance of that air and the calibration.
    """

    numbers: tuple[int, ...] = eqx.field(static=True)
    fk1: Float[Array, " bands"]
    fk2: Float[Array, " bands"]
    bc1: Float[Array, " bands"]
    bc2: Float[Array, " bands"]
    path: Float[Array, " bands"]
    gain: Float[Array, " bands"]

    @classmethod
    def of(cls, bands: Sequence[Band]) -> "EmissiveBands | None":
        """Make those of the bands that emit; None if none does."""
        emissive = [band for band in bands if band.planck is not None]
        if not emissive:
            return None
        constants = np.array([band.planck for band in emissive], float)
        return cls(
            tuple(band.number for band in emissive),
            *(_row(column) for column in constants.T),
            path=jnp.zeros(len(emissive)),
            gain=jnp.ones(len(emissive)),
        )

    def planck(
        self, temperature_k: Float[Array, "*points"]
    ) -> Float[Array, "bands *points"]:
        """Return the radiance of a black body; below 1 K it stays as at 1 K."""
        bands = zip(self.fk1, self.fk2, self.bc1, self.bc2, strict=True)
        return jnp.stack([planck.radiance(*band, temperature_k) for band in bands])

    def brightness_temperature_k(
        self, radiance: Float[Array, "bands rays"]
    ) -> Float[Array, "bands rays"]:
        """Invert `planck`; radiances that are not positive give 0 K."""
        fk1, fk2, bc1, bc2 = (
            c[:, None] for c in (self.fk1, self.fk2, self.bc1, self.bc2)
        )
        positive = radiance > 0
        some = jnp.where(positive, radiance, 1.0)
        kelvin = planck.brightness_temperature_k(fk1, fk2, bc1, bc2, some)
        return jnp.where(positive, kelvin, 0.0)


def _row(numbers: Sequence[float] | np.ndarray) -> Float[Array, " bands"]:
    return jnp.asarray(np.array(numbers), float)
