"""The rays of an image sorted by their pixels' footprints."""

from collections.abc import Callable, Iterator

import numpy as np
from jaxtyping import Int

from cloudjax.geometry.footprint import Kind, grouped, kinds
from cloudjax.geometry.rays import Rays
from cloudjax.march.scene import Scene
from cloudjax.march.view import tiles
from cloudjax.workers import each


# The lines of sight of the rays of these numbers.
Sight = Callable[[Int[np.ndarray, " rays"]], Rays]

_SORTED_AT_ONCE = 1 << 15


def some_rays(sight: Rays | Sight, index: Int[np.ndarray, " some"]) -> Rays:
    """Make the rays of these numbers."""
    return sight[index] if isinstance(sight, Rays) else sight(index)


def sorted_by_kind(
    scene: Scene, sight: Rays | Sight, count: int
) -> Iterator[tuple[Kind, Int[np.ndarray, " rays"]]]:
    """Give each kind of ray and the numbers of its rays."""

    def rows_from(start: int) -> Int[np.ndarray, "rays 7"]:
        numbers = np.arange(start, min(start + _SORTED_AT_ONCE, count))
        some = some_rays(sight, numbers)
        return kinds(some, scene.shell, scene.shells).astype(np.int16)

    rows = np.concatenate([*each(range(0, count, _SORTED_AT_ONCE), rows_from)])
    rows[rows[:, 5] == 0] = 0
    yield from grouped(rows)


def batches(
    numbers: Int[np.ndarray, " rays"], tile: int, tiles_at_once: int
) -> Iterator[tuple[Int[np.ndarray, " some"], Int[np.ndarray, " filled"]]]:
    """Cut into tiles, but many tiles at a time as long as there are enough."""
    whole = len(numbers) - len(numbers) % (tile * tiles_at_once)
    yield from tiles(numbers[:whole], tile * tiles_at_once)
    yield from tiles(numbers[whole:], tile)
