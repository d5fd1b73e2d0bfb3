"""Shells that are thin, thick, low, nested or none."""

from dataclasses import replace

import jax.numpy as jnp

from cloudjax import Shell, StandardAtmosphere
from tests.extreme_scenes import Seen

from .looks import CLOUDY, SIMPLE, kelvin_of, require_close, seen_by
from .rows import row


def _in_shell(bottom_m: float, top_m: float, **values: float) -> Seen:
    kind = replace(SIMPLE, shells=(Shell(bottom_m, top_m),))
    middle = {"base_m": bottom_m - 1e3, "top_m": top_m + 1e3}
    return seen_by(kind=kind, mask=CLOUDY, at=middle | values)


@row("Shells", "10 m thick", slow=True)
def thin_shell() -> str:
    seen = _in_shell(3000.0, 3010.0, extinction_per_m=0.05)
    require_close(float(seen.depth.mean()), 0.5, 0.01)
    return f"Depth {seen.depth.mean():.3f} where 10 m of 0.05 m⁻¹ make 0.5."


@row("Shells", "20 km thick", slow=True)
def thick_shell() -> str:
    seen = _in_shell(0.0, 20e3, extinction_per_m=1e-4)
    require_close(float(seen.depth.mean()), 2.0, 0.02)
    return f"Depth {seen.depth.mean():.3f} where 20 km of 10⁻⁴ m⁻¹ make 2."


@row("Shells", "Touching the ground", slow=True)
def low_shell() -> str:
    seen = _in_shell(0.0, 500.0, extinction_per_m=0.1)
    air = float(StandardAtmosphere()(jnp.asarray(250.0)))
    assert abs(kelvin_of(seen) - air) < 5
    return f"Fog of {kelvin_of(seen):.1f} K in air of {air:.1f} K."


@row("Shells", "One inside another", slow=True)
def nested() -> str:
    kind = replace(SIMPLE, shells=(Shell(1e3, 9e3), Shell(4e3, 5e3)))
    open_shells = {"base_m": -1e3, "top_m": 13e3, "base_m_b": -1e3, "top_m_b": 13e3}
    depths = {"extinction_per_m": 1e-4, "extinction_per_m_b": 1e-3}
    growth = {"extinction_growth_b": 0.0}
    seen = seen_by(kind=kind, mask=CLOUDY, at=open_shells | depths | growth)
    require_close(float(seen.depth.mean()), 1.8, 0.02)
    return f"Depths add up: {seen.depth.mean():.3f}, where 0.8 and 1 make 1.8."


@row("Shells", "Top below base")
def upside_down() -> str:
    try:
        Shell(3000.0, 2000.0)
    except ValueError as error:
        sentence = str(error)
    else:
        raise AssertionError("a shell without air was accepted")
    seen = seen_by(base_m=5000.0, top_m=2000.0, mask=0.5)
    assert seen.cover.max() < 1e-3
    return f"Shells are refused (“{sentence}”); barriers so leave no cloud."
