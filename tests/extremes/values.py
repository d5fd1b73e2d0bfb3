"""Radii, radiances and histograms at the ends of what they can be."""

import jax
import jax.numpy as jnp
import numpy as np

from cloudjax import EmissiveBands, Particles, bands_named
from cloudjax.light.optics import radius_limits_um
from cloudjax_fit.histogram import Bins, cumulative, spline_histogram

from .looks import CLOUDY, require_close, seen_by
from .rows import row


@row("Particles", "Radii at and beyond the ends of the tables")
def radii() -> str:
    limits = radius_limits_um("water")
    for outer, end in zip((1e-3, 1e4), limits, strict=True):
        both = [Particles("water", r).co_albedo_in([2, 5, 6]) for r in (outer, end)]
        np.testing.assert_allclose(*both, rtol=1e-5)
        seen_by(mask=CLOUDY, radius_um=outer)
    return f"The ends hold: {limits[0]:g} and {limits[1]:g} µm for droplets."


@row("Radiances", "0, negative noise, saturation")
def odd_radiances() -> str:
    bands = EmissiveBands.of(bands_named(13))
    assert bands is not None
    values = jnp.asarray([[0.0, -0.5, 1e-10, 1e3]])
    kelvin = np.asarray(bands.brightness_temperature_k(values))[0]
    slopes = jax.grad(lambda x: bands.brightness_temperature_k(x).sum())(values)
    assert np.isfinite(kelvin).all()
    assert np.isfinite(np.asarray(slopes)).all()
    assert kelvin[0] == kelvin[1] == 0
    return (
        f"0 and less are 0 K, 10⁻¹⁰ is {kelvin[2]:.0f} K and 1000 is {kelvin[3]:.0f} K "
        "in band 13. Derivatives are finite."
    )


def _histogram(values, weights) -> np.ndarray:
    bins = Bins(0.0, 10.0, 8)

    def made(v):
        return cumulative(spline_histogram(v, jnp.asarray(weights, float), bins))

    values = jnp.asarray(values, float)
    for mode in (jax.jacfwd, jax.jacrev):
        assert np.isfinite(np.asarray(mode(made)(values))).all()
    return np.asarray(made(values))


@row("Histograms", "One distinct value")
def one_value() -> str:
    found = _histogram(np.full(50, 5.0), np.ones(50))
    require_close(float(found[-1]), 1.0, 1e-6)
    return f"All weight in {int((np.diff(found, prepend=0) > 1e-6).sum())} of 8 bins."


@row("Histograms", "Empty bins, and no weight at all")
def empty_bins() -> str:
    assert not _histogram(np.full(50, 5.0), np.zeros(50)).any()
    found = _histogram([1.0, 9.0], [1.0, 1.0])
    assert (np.diff(found, prepend=0) == 0).any()
    return "Zeros, with derivatives of zero."


@row("Histograms", "One cloud pixel")
def one_pixel() -> str:
    found = _histogram([3.3], [1.0])
    require_close(float(found[-1]), 1.0, 1e-6)
    return "It is shared by three bins, and its derivatives are finite."
