"""The sea mirrors the sun in facets that the wind tilts: its glint.

Slopes are those of Cox and Munk (1954, J. Opt. Soc. Am. 44, 838), the same to all
sides. Waves hide each other from sun and viewer by Smith's function, in the form for
two directions of Mishchenko and Travis (1997, J. Geophys. Res. 102, 16989, eq. 18).
"""

import jax.numpy as jnp
from jax.scipy.special import erfc
from jaxtyping import Array, Float


def slope_variance(wind_m_s: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Return the mean square slope of the sea, both ways together (Cox and Munk 1954,
    clean surface), for a wind at 12.5 m above it; that at 10 m is 2 % less.
    """
    return 0.003 + 5.12e-3 * wind_m_s


def fresnel(
    cosine: Float[Array, "*#n"], refraction: Float[Array, "*#n"]
) -> Float[Array, "*n"]:
    """Return the reflectance of a flat face for unpolarised light.

    **Arguments:** `cosine`: of the angle of incidence; `refraction`: the real index.
    """
    below = jnp.sqrt(refraction**2 - 1 + cosine**2)
    across = (cosine - below) / (cosine + below)
    along = (refraction**2 * cosine - below) / (refraction**2 * cosine + below)
    return (across**2 + along**2) / 2


def glint(
    sun: Float[Array, " rays"],
    view: Float[Array, " rays"],
    scattering: Float[Array, " rays"],
    variance: Float[Array, " rays"],
    refraction: Float[Array, " bands"],
) -> Float[Array, "bands rays"]:
    """Return the reflectance factor πL/E of the sun's mirror image in the sea.

    **Arguments:**

    - `sun`, `view`: cosines of their zenith angles; it is 0 unless both are positive.
    - `scattering`: cosine of the angle between the sun's rays and the light seen.
    - `variance`: of slopes, as of `slope_variance`.
    - `refraction`: real index of water.
    """
    lit = (sun > 0) & (view > 0)
    # Where a derivative of a root would not be finite there is no light to speak of.
    sun, view = (jnp.clip(cosine, 1e-3, 1) for cosine in (sun, view))
    incidence = jnp.sqrt(jnp.maximum((1 - scattering) / 2, 1e-6))
    tilt2 = jnp.minimum(((sun + view) / (2 * incidence)) ** 2, 1)
    facing = jnp.exp(-(1 / tilt2 - 1) / variance) / (variance * tilt2**2)
    seen = 1 / (1 + _hidden(sun, variance) + _hidden(view, variance))
    mirrored = fresnel(incidence[None], refraction[:, None])
    return mirrored * jnp.where(lit, facing * seen / (4 * view), 0.0)[None]


def _hidden(cosine, variance):
    """Smith's Λ, how much wave there is in front of what would be seen."""
    sine = jnp.sqrt(jnp.maximum(1 - cosine**2, 1e-6))
    # Beyond nothing is hidden, to the last digit.
    ν = jnp.minimum(cosine / (sine * jnp.sqrt(variance)), 5.0)
    return (jnp.exp(-(ν**2)) / (ν * jnp.sqrt(jnp.pi)) - erfc(ν)) / 2
