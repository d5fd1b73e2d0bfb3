"""No cloud, all cloud, clouds of any depth."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np

from cloudjax import StandardAtmosphere

from .looks import (
    CLEAR,
    CLOUDY,
    SIMPLE,
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


def _partly(pixel_rad: float, smoothing: float) -> float:
    """The share of pixels that are partly cloudy, of clear and cloudy ones."""
    # A quarter of the usual steps' length, for a step that is cut is partly cloudy.
    kind = replace(SIMPLE, steps=24)
    rays = near(pixel_rad=pixel_rad)
    cover = seen_by(rays, kind=kind, smoothing=smoothing, mask=-0.5).cover
    assert cover.min() < 0.02
    assert cover.max() > 0.98
    return ((cover > 0.02) & (cover < 0.98)).mean()


@row("Clouds", "Threshold of no width, pixels of no width", slow=True)
def no_width() -> str:
    hard, soft = _partly(1e-12, 0.0), _partly(5.6e-5, 0.5)
    # Measured: 0.08.
    assert hard < 0.15
    return (
        f"A hard level set, but for steps that it cuts: {hard:.0%} of the pixels are "
        f"partly cloudy, {soft:.0%} of soft ones of 2 km. Derivatives are finite."
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
