"""An imager calls a column cloudy from some optical depth on."""

from typing import TypeVar

import numpy as np
from jaxtyping import Array


_Depth = TypeVar("_Depth", Array, np.ndarray, float)

# Optical depth at which imagers begin to call a pixel cloudy.
VISIBLE_DEPTH = 0.3


def unseen(depth: _Depth) -> _Depth:
    """Return how much of a column of this vertical optical depth counts as clear."""
    return 1 / (1 + (depth / VISIBLE_DEPTH) ** 2)
