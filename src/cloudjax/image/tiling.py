"""The rays of an image are taken so many at a time."""

from collections.abc import Callable, Iterator

import numpy as np
from jaxtyping import Int

from cloudjax.geometry.rays import Rays
from cloudjax.march.view import tiles


# The lines of sight of the rays of these numbers.
Sight = Callable[[Int[np.ndarray, " rays"]], Rays]


def some_rays(sight: Rays | Sight, index: Int[np.ndarray, " some"]) -> Rays:
    """Make the rays of these numbers."""
    return sight[index] if isinstance(sight, Rays) else sight(index)


def batches(
    numbers: Int[np.ndarray, " rays"], tile: int, tiles_at_once: int
) -> Iterator[tuple[Int[np.ndarray, " some"], Int[np.ndarray, " filled"]]]:
    """Cut into tiles, but many tiles at a time as long as there are enough."""
    whole = len(numbers) - len(numbers) % (tile * tiles_at_once)
    yield from tiles(numbers[:whole], tile * tiles_at_once)
    yield from tiles(numbers[whole:], tile)
