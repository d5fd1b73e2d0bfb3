"""Digits and nodes."""

from dataclasses import replace

import jax
import numpy as np

from .looks import SIMPLE, seen_by
from .rows import row


@row("Numbers", "float32 and float64", slow=True)
def precision() -> str:
    single = seen_by(mask=0.5)
    with jax.enable_x64(True):
        double = seen_by(mask=0.5)
    assert double.radiance.dtype == np.float64
    values, slopes = (
        np.abs(getattr(single, name) - getattr(double, name)).max()
        / np.abs(getattr(double, name)).max()
        for name in ("radiance", "reverse")
    )
    assert values < 1e-4
    assert slopes < 1e-3
    return f"They differ by {values:.0e} of the largest; derivatives by {slopes:.0e}."


@row("Numbers", "1 and 5 sub-pixel nodes", slow=True)
def nodes() -> str:
    covers = [
        seen_by(kind=replace(SIMPLE, nodes=n), mask=0.5).cover.mean() for n in (1, 3, 5)
    ]
    assert max(covers) - min(covers) < 0.1
    return (
        f"Mean cover is {covers[0]:.3f} and {covers[2]:.3f} ({covers[1]:.3f} of three)."
    )
