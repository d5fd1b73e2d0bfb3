"""Strategies for light in clouds turn a march into reflected sunlight.

The paper's strategy, `TwoFlux`, solves eqs (2a, 2b) exactly instead of by the rough
fits (3) and (4), and is equal to (3) without absorption; docs/theory/paper.md lists the
differences. It has no phase function and takes the whole extinction for back-scatter,
so that its extinction is about (1 - g)/2, a thirteenth, of the physical one.
"""

import abc
from collections.abc import Callable
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from .phase import AbstractPhase, HenyeyGreenstein
from .reflectance import PlaneParallel


class Illumination(eqx.Module):
    """An `Illumination` says how the sun stands to the cloud, and the cloud to the
    viewer.

    **Fields:**

    - `lit`, `shaded`: means of max(n·s, 0) and max(-n·s, 0) over the surface that is
      seen, n the normals and s the direction of the sun; None for strategies that see
      no slopes.
    - `sun_height`, `view_height`: cosines of the zenith angles of sun and viewer.
    - `scattering`: cosine of the angle between the sun's rays and the light that is
      seen, -1 with the sun behind the viewer.
    """

    lit: Float[Array, "nodes rays"] | None
    shaded: Float[Array, "nodes rays"] | None
    sun_height: Float[Array, " rays"]
    view_height: Float[Array, " rays"]
    scattering: Float[Array, " rays"]


class Scatterers(eqx.Module):
    """`Scatterers` are cloud particles as one band, or several, see them.

    **Fields:** `co_albedo`: 1 - ω. `asymmetry`: mean cosine of the scattering angle.
    """

    co_albedo: Float[Array, "*bands"]
    asymmetry: Float[Array, "*bands"]


class Returned(eqx.Module):
    """A `Returned` says what becomes of sunlight in a cloud.

    **Fields:**

    - `reflectance`: factor πL/E of the cloud alone.
    - `transmittance`: of what is behind it, on the way down and up.
    - `back`: share of the light from behind that the cloud sends back there.
    """

    reflectance: Float[Array, "nodes rays"]
    transmittance: Float[Array, "nodes rays"]
    back: Float[Array, "nodes rays"]

    @staticmethod
    def by_none(optical_depth: Float[Array, "nodes rays"]) -> "Returned":
        """Say it for clear air, in the shape of some optical depths."""
        none = jnp.zeros_like(optical_depth)
        return Returned(none, jnp.ones_like(none), none)


class AbstractReflection(eqx.Module):
    """A strategy of reflection says how sunlight comes back from a cloud.

    **Fields:**

    - `sees_slopes`: whether it asks how the surface is turned to the sun.
    - `is_quick`: whether to find the slabs with cloud takes longer than to evaluate it
      for all of them.
    """

    sees_slopes: ClassVar[bool] = False
    is_quick: ClassVar[bool] = False

    @abc.abstractmethod
    def __call__(
        self,
        optical_depth: Float[Array, "nodes rays"],
        particles: Scatterers,
        light: Illumination,
    ) -> Returned:
        """Find what the cloud of one layer does to sunlight in one band.

        **Arguments:**

        - `optical_depth`: along the line of sight.
        - `particles`: in the band.
        - `light`: how the sun stands to the cloud.
        """


class TwoFlux(AbstractReflection):
    """The cloud is the paper's one-dimensional slab with a Lambertian surface (Schinder
    et al. 2024, section 2.3).

    **Fields:** `indirect`: the share of the light that reaches the surface from
    everywhere above instead of straight from the sun.
    """

    indirect: Float[Array, ""]
    sees_slopes: ClassVar[bool] = True
    is_quick: ClassVar[bool] = True

    def __call__(self, optical_depth, particles, light):
        if light.lit is None or light.shaded is None:
            raise ValueError("TwoFlux needs slopes: sample the clouds with gradients.")
        reflected, transmitted = slab(optical_depth, particles.co_albedo)
        through = jnp.exp(-optical_depth)
        # What the far side emits is what came through by scattering: eq. (3a) less
        # the direct beam, eq. (5), which the background already has. Never negative,
        # for exp(τ) >= 1 + τ.
        diffuse = jnp.maximum(transmitted - through, 0)
        overhead = jnp.maximum(light.sun_height, 0)[None] * reflected
        direct = light.lit * reflected + light.shaded * diffuse
        day = (light.sun_height > 0)[None]
        seen = (1 - self.indirect) * direct + self.indirect * overhead
        return Returned(jnp.where(day, seen, 0.0), through, jnp.zeros_like(through))


class Slabs(AbstractReflection):
    """Each pixel's cloud is a plane-parallel slab, for the actual sun and viewer.

    It has the phase function of the particles, and agrees with DISORT within a few
    parts in a thousand (docs/theory/reflectance.md). Viewers are above the cloud.

    **Fields:** `networks`; `phase`: the kind of phase function, of an asymmetry.
    """

    networks: PlaneParallel
    phase: Callable[[Array], AbstractPhase] = eqx.field(
        static=True, default=HenyeyGreenstein
    )

    def __call__(self, optical_depth, particles, light):
        phase = self.phase(particles.asymmetry)
        sun, view, scattering = (
            jnp.broadcast_to(cosine[None], optical_depth.shape)
            for cosine in (light.sun_height, light.view_height, light.scattering)
        )
        slab = (optical_depth * view, particles.co_albedo, phase)
        height = jnp.maximum(sun, 0)
        reflected = height * self.networks.reflectance(*slab, sun, view, scattering)
        _, down = self.networks.albedo_and_transmittance(*slab, sun)
        _, up = self.networks.albedo_and_transmittance(*slab, view)
        return Returned(reflected, down * up, self.networks.spherical_albedo(*slab))


def slab(
    optical_depth: Float[Array, "*n"], co_albedo: Float[Array, ""]
) -> tuple[Float[Array, "*n"], Float[Array, "*n"]]:
    """Return reflectance and transmittance of eqs (2a, 2b) with (2b)'s sign put right.

    With K² = 1 - ω² per unit optical depth and t = tanh(K τ)/K,

        R = ω t / (1 + t),    T = sech(K τ) / (1 + t),

    which is eq. (3) for ω = 1, where t = τ. Both are finite, with their gradients, for
    optical depths from 0 to infinity and 1 - ω in [0, 1].
    """
    # Beyond, 1/τ is nothing to float32; τ⁴ in derivatives would overflow.
    optical_depth = jnp.minimum(optical_depth, 1e9)
    k2 = co_albedo * (2 - co_albedo)
    x2 = k2 * optical_depth**2
    t = optical_depth * _tanh_over(x2)
    return (1 - co_albedo) * t / (1 + t), _sech(x2) / (1 + t)


def _tanh_over(x2):
    """tanh(x)/x as a smooth function of x²."""
    small = x2 < 1e-2
    x = jnp.sqrt(jnp.where(small, 1.0, x2))
    y = jnp.where(small, x2, 0.0)  # powers of large x² overflow
    series = 1 - y / 3 + 2 * y**2 / 15 - 17 * y**3 / 315
    return jnp.where(small, series, jnp.tanh(x) / x)


def _sech(x2):
    """1/cosh(x) as a smooth function of x²."""
    small = x2 < 1e-2
    x = jnp.sqrt(jnp.where(small, 1.0, x2))
    decay = jnp.exp(-jnp.minimum(x, 80.0))
    y = jnp.where(small, x2, 0.0)
    series = 1 - y / 2 + 5 * y**2 / 24 - 61 * y**3 / 720
    return jnp.where(small, series, 2 * decay / (1 + decay**2))
