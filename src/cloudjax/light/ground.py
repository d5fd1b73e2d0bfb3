"""The ground lies below the clouds: land and sea, or clear radiances that were
observed.

A ground answers in two parts, as a source of cloud does: `look` reads on the host what
depends on places, `seen` finds radiances from that and from the ground's parameters.
"""

import abc
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from cloudjax.geometry.fixed_grid import FixedGrid
from cloudjax.geometry.latlon_grid import AnyArray, LatLonGrid
from cloudjax.geometry.path import device_array
from cloudjax.geometry.rays import GroundPoints, Rays

from .bands import EmissiveBands, ReflectiveBands


class Leaving(eqx.Module):
    """This is the light that leaves the ground towards the rays.

    **Fields:**

    - `reflectance`: factor πL/E in reflective bands; None where none is asked.
    - `radiance`: in emissive bands; None where none is asked.
    - `glint`: factor πL/E of the sun's mirror image, beside `reflectance`; clouds hide
      it, and diffuse light has none. None for ground without.
    """

    reflectance: Float[Array, "reflective rays"] | None
    radiance: Float[Array, "emissive rays"] | None
    glint: Float[Array, "reflective rays"] | None = None


class GroundSamples(eqx.Module):
    """`GroundSamples` hold what is known of the places where rays meet the ground, rays
    first.

    **Fields:**

    - `hit`: whether the ray meets the Earth.
    - `sun_height`: cosine of the sun's zenith angle, 0 at night.
    - `altitude_m`: above the ellipsoid.
    - `properties`: what the kind of ground keeps for itself.
    """

    hit: Bool[Array, " rays"]
    sun_height: Float[Array, " rays"]
    altitude_m: Float[Array, " rays"]
    properties: Any = None

    @classmethod
    def of(
        cls,
        places: GroundPoints,
        hit: Bool[np.ndarray, " rays"],
        sun_direction: Float[np.ndarray, "3"],
        altitude_m: Float[np.ndarray, " rays"] | None = None,
        properties: Any = None,
    ) -> "GroundSamples":
        """Keep places with the height of the sun over them."""
        height = np.maximum(places.upward @ sun_direction, 0)
        if altitude_m is None:
            altitude_m = np.zeros(len(hit))
        return cls(
            jnp.asarray(hit), device_array(height), device_array(altitude_m), properties
        )


class AbstractGround(eqx.Module):
    """A ground is land and sea below a scene.

    **Fields:** `under_air`: whether the air of the scene lies over what `seen` gives;
    not so for radiances that were observed from space.
    """

    under_air: ClassVar[bool] = True

    @abc.abstractmethod
    def look(
        self,
        rays: Rays,
        places: GroundPoints,
        hit: Bool[np.ndarray, " rays"],
        sun_direction: Float[np.ndarray, "3"],
        reflective: ReflectiveBands | None,
        emissive: EmissiveBands | None,
    ) -> GroundSamples:
        """Read what depends on the places, on the host.

        **Arguments:** `hit`: which rays meet the Earth; the places of the others are
        where they come closest.
        """

    @abc.abstractmethod
    def seen(
        self,
        samples: GroundSamples,
        reflective: ReflectiveBands | None,
        emissive: EmissiveBands | None,
    ) -> Leaving:
        """Find the light that leaves the ground. Differentiable by its parameters."""


class UniformGround(AbstractGround):
    """This ground is Lambertian and the same everywhere, at sea level.

    **Fields:**

    - `albedo`: in every reflective band.
    - `temperature_k`: of the skin.
    - `emissivity`: in every emissive band.
    """

    albedo: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=0.05)
    temperature_k: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=288.15)
    emissivity: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=0.98)

    def look(
        self, rays, places, hit, sun_direction, reflective, emissive
    ) -> GroundSamples:
        """Keep which rays meet the Earth, and the height of the sun there."""
        del rays, reflective, emissive
        return GroundSamples.of(places, hit, sun_direction)

    def seen(self, samples, reflective, emissive) -> Leaving:
        """Reflect the sun and emit, the same everywhere."""
        reflected = emitted = None
        if reflective is not None:
            ones = jnp.ones(len(reflective.numbers))
            reflected = self.albedo * ones[:, None] * samples.sun_height[None]
        if emissive is not None:
            planck = emissive.planck(self.temperature_k * jnp.ones(1))
            emitted = self.emissivity * planck * jnp.ones_like(samples.sun_height)[None]
        return Leaving(reflected, emitted)


class Lambertian(eqx.Module):
    """These are the properties of the ground below each ray.

    **Fields:** `albedo`, `emissivity`: by band; None where no such band is asked.
    `temperature_k`: of the skin. `glint`: as of `Leaving`, for ground that mirrors the
    sun besides.
    """

    albedo: Float[Array, "rays reflective"] | None
    emissivity: Float[Array, "rays emissive"] | None
    temperature_k: Float[Array, " rays"]
    glint: Float[Array, "rays reflective"] | None = None


class AbstractMappedGround(AbstractGround):
    """This ground is Lambertian, but for its glint, with properties that differ from
    place to place.

    Kinds of it say in `look` what they are, as `Lambertian` properties.
    """

    def seen(self, samples, reflective, emissive) -> Leaving:
        """Reflect the sun and emit, by the properties of each place."""
        ground: Lambertian = samples.properties
        reflected = emitted = glint = None
        if reflective is not None and ground.albedo is not None:
            reflected = ground.albedo.T * samples.sun_height[None]
        if emissive is not None and ground.emissivity is not None:
            emitted = ground.emissivity.T * emissive.planck(ground.temperature_k)
        if reflective is not None and ground.glint is not None:
            glint = ground.glint.T
        return Leaving(reflected, emitted, glint)


class ClearRadiances(eqx.Module):
    """These are the clear radiances of each ray, in the units of the bands; None where
    no such band is asked.
    """

    reflective: Float[Array, "rays reflective"] | None
    emissive: Float[Array, "rays emissive"] | None


class ClearSky(AbstractGround):
    """A `ClearSky` holds radiances without cloud as they were observed from space, on a
    grid.

    They hold the light of the air already.

    **Fields:**

    - `reflective`, `emissive`: radiances in the units of the scene's bands, in their
      order; None where no such band is asked.
    - `grid`: the places of the nodes.
    """

    reflective: Float[AnyArray, "rows columns reflective"] | None
    emissive: Float[AnyArray, "rows columns emissive"] | None
    grid: LatLonGrid | FixedGrid = eqx.field(static=True)
    under_air: ClassVar[bool] = False

    def look(
        self, rays, places, hit, sun_direction, reflective, emissive
    ) -> GroundSamples:
        """Interpolate the radiances to the places, bilinear."""
        del rays
        read = [
            None
            if bands is None or nodes is None
            else device_array(
                np.asarray(
                    self.grid.sample(nodes, places.latitude_deg, places.longitude_deg)
                )
            )
            for bands, nodes in (
                (reflective, self.reflective),
                (emissive, self.emissive),
            )
        ]
        return GroundSamples.of(
            places, hit, sun_direction, properties=ClearRadiances(*read)
        )

    def seen(self, samples, reflective, emissive) -> Leaving:
        """Give the radiances that were read."""
        clear: ClearRadiances = samples.properties
        reflected = emitted = None
        if reflective is not None and clear.reflective is not None:
            reflected = reflective.reflectance(clear.reflective.T)
        if emissive is not None and clear.emissive is not None:
            emitted = clear.emissive.T
        return Leaving(reflected, emitted)
