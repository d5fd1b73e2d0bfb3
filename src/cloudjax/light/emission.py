"""Thick cloud is no black body, because it scatters thermal radiation.

Without scattering, cloud is a pure absorber. Droplets scatter most of what they meet at
3.9 µm and a good part elsewhere, so that a thick cloud emits 1 - R of Planck's radiance
and looks colder than it is: by several kelvin at 3.9 µm, by one to three in the windows
(docs/theory/model.md has the figures).
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from .optics import effective_share
from .phase import HenyeyGreenstein
from .reflectance import PlaneParallel, above_horizon
from .reflection import Scatterers


# The networks know phase functions up to this asymmetry best. The forward peak of more
# asymmetric ones is cut off, and counts as not scattered.
LARGEST_ASYMMETRY = 0.9
# Thinner slabs scatter once at most, so that both factors stay as they are there.
LEAST_DEPTH = 0.1


class Factors(eqx.Module):
    """`Factors` say what scattering changes, relative to a pure absorber.

    **Fields:** `emitted`, `stopped`: factors on what is emitted towards the viewer and
    on what is hidden of the background.
    """

    emitted: Float[Array, "nodes rays"]
    stopped: Float[Array, "nodes rays"]

    @staticmethod
    def of_absorber(absorption_depth: Float[Array, "nodes rays"]) -> "Factors":
        """Return the factors of cloud that only absorbs, in the shape of its depths."""
        one = jnp.ones_like(absorption_depth)
        return Factors(one, one)


class EmittingSlabs(eqx.Module):
    """Each pixel's cloud is a plane-parallel slab that scatters what it emits.

    The emissivity is 1 - R - T for light from the viewer, by Kirchhoff's law; along the
    way it is shared out as a pure absorber's. Light from behind is isotropic, the sky
    above is black. Viewers are above the cloud.

    **Fields:** `networks`.
    """

    networks: PlaneParallel

    def __call__(
        self,
        absorption_depth: Float[Array, "nodes rays"],
        particles: Scatterers,
        view_height: Float[Array, " rays"],
    ) -> Factors:
        """Return the factors of one layer in one band.

        **Arguments:**

        - `absorption_depth`: of the pure absorber, along the line of sight.
        - `particles`: in the band.
        - `view_height`: cosine of the viewer's zenith angle.
        """
        share = effective_share(particles.co_albedo, particles.asymmetry)
        view = jnp.broadcast_to(view_height[None], absorption_depth.shape)
        slant = share / above_horizon(view)
        depth = jnp.maximum(absorption_depth / slant, LEAST_DEPTH)
        emissivity, albedo = self.networks.emissivity_and_albedo(
            *_without_peak(depth, particles), view
        )
        absorber = -jnp.expm1(-depth * slant)
        return Factors(emissivity / absorber, (emissivity + albedo) / absorber)


def _without_peak(depth, particles: Scatterers):
    """The same slab with the forward peak f of its phase function cut off.

    τ (1 - ωf), ω (1 - f)/(1 - ωf), (g - f)/(1 - f): Joseph et al. (1976, J. Atmos. Sci.
    33, 2452).
    """
    albedo, g = 1 - particles.co_albedo, particles.asymmetry
    peak = jnp.maximum(g - LARGEST_ASYMMETRY, 0) / (1 - LARGEST_ASYMMETRY)
    left = 1 - albedo * peak
    phase = HenyeyGreenstein((g - peak) / (1 - peak))
    return depth * left, particles.co_albedo / left, phase
