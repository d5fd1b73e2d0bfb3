"""The particles of a cloud absorb and scatter light in the bands of a scene.

`ParticleOptics` follow the size of particles; `GivenOptics` are numbers, for clouds
that no particles are known of. All is per extinction of the cloud, so that how much
cloud there is and of what it is made are apart.
"""

import abc
from dataclasses import KW_ONLY

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from .optics import Particles
from .reflection import Scatterers


class AbstractCloudOptics(eqx.Module):
    """The optics of a cloud tell how a scene's bands see it.

    Extinctions are relative to β, the extinction that the scene's light knows of the
    cloud. Reflective bands are those that see the sun, emissive ones those that emit.
    """

    @property
    @abc.abstractmethod
    def extinction(self) -> Float[Array, " reflective"]:
        """Give the extinction in each reflective band, over β."""

    @property
    @abc.abstractmethod
    def scatterers(self) -> Scatterers:
        """Give the particles in each reflective band."""

    @property
    @abc.abstractmethod
    def absorption(self) -> Float[Array, " emissive"]:
        """Give that of the pure absorber that stands for the cloud in each emissive
        band, over β: see `Particles.effective_absorption_in`.

        **Raises:** `ValueError` where it is not known.
        """

    @property
    @abc.abstractmethod
    def emitters(self) -> Scatterers:
        """Give the particles in each emissive band.

        **Raises:** `ValueError` where they are not known.
        """


class ParticleOptics(AbstractCloudOptics):
    """`ParticleOptics` are those of particles, and follow their radius.

    **Fields:**

    - `particles`: phase and effective radius.
    - `infrared_ratio`: absorption at 10.35 µm over β where it is known better than the
      particles know it; None for theirs.
    - `sunlit`, `thermal`: numbers of the reflective and of the emissive bands.
    - `share`: of the particles' extinction at 0.64 µm that the scene's light calls β;
      absorption in the infrared stays theirs.
    """

    particles: Particles
    infrared_ratio: Float[Array, ""] | None = None
    sunlit: tuple[int, ...] = eqx.field(static=True, default=())
    thermal: tuple[int, ...] = eqx.field(static=True, default=())
    share: float = eqx.field(static=True, default=1.0)

    @property
    def extinction(self) -> Float[Array, " reflective"]:
        return self.particles.relative_extinction_in(self.sunlit)

    @property
    def scatterers(self) -> Scatterers:
        return Scatterers(
            self.particles.co_albedo_in(self.sunlit),
            self.particles.asymmetry_in(self.sunlit),
        )

    @property
    def absorption(self) -> Float[Array, " emissive"]:
        ratio = self.infrared_ratio
        if ratio is None:
            ratio = self.particles.infrared_ratio / self.share
        return ratio * self.particles.relative_absorption_in(self.thermal)

    @property
    def emitters(self) -> Scatterers:
        return Scatterers(
            self.particles.thermal_co_albedo_in(self.thermal),
            self.particles.thermal_asymmetry_in(self.thermal),
        )


class GivenOptics(AbstractCloudOptics):
    """`GivenOptics` are numbers that follow from nothing.

    **Fields:**

    - `co_albedo`: 1 - ω in each reflective band.
    - `asymmetry`: mean scattering cosine in each reflective band; None is 0.
    - `relative_extinction`: of each reflective band over β; None is 1.
    - `infrared_ratio`: absorption over β at the emissive reference band.
    - `relative_absorption`: of each emissive band, 1 at the reference band. Scenes
      without emissive bands need neither.
    - `thermal_co_albedo`, `thermal_asymmetry`: 1 - ω and mean scattering cosine in each
      emissive band; for scenes whose cloud scatters there.
    """

    co_albedo: Float[Array, " reflective"]
    _: KW_ONLY
    asymmetry: Float[Array, " reflective"] | None = None
    relative_extinction: Float[Array, " reflective"] | None = None
    infrared_ratio: Float[Array, ""] | None = None
    relative_absorption: Float[Array, " emissive"] | None = None
    thermal_co_albedo: Float[Array, " emissive"] | None = None
    thermal_asymmetry: Float[Array, " emissive"] | None = None

    @property
    def extinction(self) -> Float[Array, " reflective"]:
        if self.relative_extinction is None:
            return jnp.ones_like(self.co_albedo)
        return self.relative_extinction

    @property
    def scatterers(self) -> Scatterers:
        none = jnp.zeros_like(self.co_albedo)
        return Scatterers(
            self.co_albedo, none if self.asymmetry is None else self.asymmetry
        )

    @property
    def absorption(self) -> Float[Array, " emissive"]:
        if self.infrared_ratio is None or self.relative_absorption is None:
            raise ValueError(
                "The optics of a cloud have no absorption in the thermal bands: give "
                "infrared_ratio and relative_absorption, or leave the bands out."
            )
        return self.infrared_ratio * self.relative_absorption

    @property
    def emitters(self) -> Scatterers:
        if self.thermal_co_albedo is None or self.thermal_asymmetry is None:
            raise ValueError(
                "The optics of a cloud have no co-albedo or asymmetry in the thermal "
                "bands: give both, or leave the scene's emission None."
            )
        return Scatterers(self.thermal_co_albedo, self.thermal_asymmetry)
