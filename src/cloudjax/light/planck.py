"""Planck's function of a band and its inverse are those that the files of ABI give.

L = fk1 / (exp(fk2 / (bc1 + bc2 T)) - 1), where fk1 and fk2 hold the band's wavenumber
and bc1 and bc2 correct for its width. Arrays of numpy and of jax serve alike: each
brings its own functions, so that this module imports neither.
"""

from typing import Any

from jaxtyping import Float


Coefficient = float | Float[Any, "..."]

# No black body is colder, so that no temperature divides by zero.
LEAST_K = 1.0
# exp overflows float32 at 88; the radiance is zero long before.
_LARGEST_EXPONENT = 80.0


def radiance(
    fk1: Coefficient,
    fk2: Coefficient,
    bc1: Coefficient,
    bc2: Coefficient,
    temperature_k: Float[Any, "*#points"],
) -> Float[Any, "*points"]:
    """Return the radiance of a black body; below 1 K it stays as at 1 K."""
    xp = temperature_k.__array_namespace__()
    effective = bc1 + bc2 * xp.maximum(temperature_k, LEAST_K)
    return fk1 / xp.expm1(xp.minimum(fk2 / effective, _LARGEST_EXPONENT))


def brightness_temperature_k(
    fk1: Coefficient,
    fk2: Coefficient,
    bc1: Coefficient,
    bc2: Coefficient,
    radiance: Float[Any, "*#points"],
) -> Float[Any, "*points"]:
    """Invert `radiance`; only positive radiances have a temperature [K]."""
    xp = radiance.__array_namespace__()
    return (fk2 / xp.log1p(fk1 / radiance) - bc1) / bc2
