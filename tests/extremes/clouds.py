"""No cloud, all cloud, clouds of any depth."""

import jax.numpy as jnp
import numpy as np

from cloudjax import StandardAtmosphere

from .looks import (
    CLEAR,
    CLOUDY,
    SUNLIT,
    THERMAL,
    black,
    kelvin_of,
    mean,
    near,
    require_close,
    seen_by,
)
from .rows import row


@row("Clouds", "Optical depth 0")
def no_depth() -> str:
    thin, clear = seen_by(mask=CLOUDY, extinction_per_m=1e-30), seen_by(mask=CLEAR)
    difference = np.abs(thin.radiance - clear.radiance).max()
    assert thin.depth.max() < 1e-20
    assert difference < 1e-4
    return f"The ground is seen; clear sky differs by {difference:.0e} at most."


@row("Clouds", "Optical depth of a million")
def huge_depth() -> str:
    huge = seen_by(mask=CLOUDY, extinction_per_m=1e3)
    less = seen_by(mask=CLOUDY, extinction_per_m=10.0)
    assert huge.depth.min() > 1e6
    change = abs(mean(huge, SUNLIT) / mean(less, SUNLIT) - 1)
    assert change < 0.01
    # No gain from more of it: derivatives are nothing beside the radiance.
    assert np.abs(huge.forward).max() < 10 * np.abs(huge.radiance).max()
    return (
        f"Depth {huge.depth.mean():.1e}: sunlight has saturated (a hundredth of "
        f"it changes {change:.1%}), {kelvin_of(huge):.1f} K, derivatives finite."
    )


@row("Clouds", "Threshold of no width, pixels of no width")
def no_width() -> str:
    seen = seen_by(near(pixel_rad=1e-12), smoothing=0.0, mask=0.5)
    between = ((seen.cover > 0.02) & (seen.cover < 0.98)).mean()
    return (
        f"A hard level set, but for steps that it cuts: {between:.0%} of the "
        "pixels are partly cloudy. Derivatives are finite."
    )


@row("Clouds", "All clear")
def all_clear() -> str:
    seen = seen_by(mask=CLEAR)
    assert seen.cover.max() == 0
    expected = 0.98 * black(290.0)
    require_close(mean(seen, THERMAL), expected, 1e-5)
    return (
        f"The ground alone: {kelvin_of(seen):.2f} K at an emissivity of 0.98 and 290 K."
    )


@row("Clouds", "All cloudy")
def all_cloudy() -> str:
    seen = seen_by(mask=CLOUDY)
    assert seen.cover.min() > 0.99
    top = float(StandardAtmosphere()(jnp.asarray(12e3)))
    assert top < kelvin_of(seen) < 290
    least = seen.cover.min()
    return f"No ground is seen: {kelvin_of(seen):.1f} K, cover {least:.3f} or more."
