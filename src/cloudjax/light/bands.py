"""Bands turn reflected sunlight and emission into radiance, in the units of files.

Reflective bands are in W m⁻² sr⁻¹ µm⁻¹, emissive ones in mW m⁻² sr⁻¹ (cm⁻¹)⁻¹, as in
ABI L1b files, whose own coefficients are the fields here. Band 7 reflects and emits:
both parts are in the units of its file, those of emission.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from . import planck


REFLECTIVE_UNITS = "W m-2 sr-1 um-1"
EMISSIVE_UNITS = "mW m-2 sr-1 (cm-1)-1"


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
