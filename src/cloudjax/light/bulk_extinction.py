"""Mass and effective radius of whole fields give extinction, by a table.

`Particles` takes one radius at a time; fields of weather models have millions.
"""

import functools as ft

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .optics import REFERENCE_BAND, Particles, radius_limits_um


_KNOTS = 65


def extinction_m2_g(
    phase: str, effective_radius_um: Float[Array, "*cells"]
) -> Float[Array, "*cells"]:
    """Return the extinction at 0.64 µm per mass of condensate [m²/g].

    It is that of `Particles`, read from a table in the logarithms to a part in ten
    thousand. Beyond the radii of the optics it falls with the radius, as that of large
    particles does: rain and graupel are there.
    """
    radius, extinction = _table(phase)
    at = jnp.log(jnp.maximum(effective_radius_um, 1e-3))
    first, last = float(radius[0]), float(radius[-1])
    place = (jnp.clip(at, first, last) - first) * ((_KNOTS - 1) / (last - first))
    low = jnp.clip(jnp.floor(place), 0, _KNOTS - 2).astype(int)
    table = jnp.asarray(extinction, at.dtype)
    before, after = table[low], table[low + 1]
    beyond = at - jnp.clip(at, first, last)
    return jnp.exp(before + (place - low) * (after - before) - beyond)


@ft.cache
def _table(phase: str) -> tuple[Float[np.ndarray, " knots"], ...]:
    """Logarithms of radii, evenly spaced, and of extinctions there."""
    low, high = radius_limits_um(phase)
    radius = np.linspace(np.log(low), np.log(high), _KNOTS)
    with jax.ensure_compile_time_eval():
        found = [
            Particles(phase, float(np.exp(r))).extinction_in([REFERENCE_BAND])[0]
            for r in radius
        ]
        extinction = np.log(np.array([float(k) for k in found]))
    return radius, extinction
