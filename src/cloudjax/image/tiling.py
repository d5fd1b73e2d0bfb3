"""The rays of an image sorted by their pixels' footprints, and cut into tiles."""

from collections.abc import Callable, Iterator

import numpy as np
from jaxtyping import Int

from cloudjax.geometry.footprint import Kind, kind_of, kinds
from cloudjax.geometry.rays import Rays
from cloudjax.geometry.shells import Shell
from cloudjax.march.scene import Scene
from cloudjax.workers import each


# The lines of sight of the rays of these numbers.
Sight = Callable[[Int[np.ndarray, " rays"]], Rays]

_SORTED_AT_ONCE = 1 << 15


def some_rays(sight: Rays | Sight, index: Int[np.ndarray, " some"]) -> Rays:
    """Those of these numbers."""
    return sight[index] if isinstance(sight, Rays) else sight(index)


def sorted_by_kind(
    scene: Scene,
    sight: Rays | Sight,
    count: int,
    *,
    alike: bool = False,
) -> Iterator[tuple[Kind, Int[np.ndarray, " rays"]]]:
    """Each kind of ray and the numbers of its rays.

    With `alike`, kinds that differ in their footprint only are told apart.
    """
    air = _air(scene)

    def rows_from(start: int) -> Int[np.ndarray, "rays 7"]:
        numbers = np.arange(start, min(start + _SORTED_AT_ONCE, count))
        return kinds(some_rays(sight, numbers), air).astype(np.int16)

    rows = np.concatenate([*each(range(0, count, _SORTED_AT_ONCE), rows_from)])
    if alike:
        rows[:, 5:] = 2, 0
    else:
        rows[rows[:, 5] == 0] = 0
    # One number per row: rows themselves sort twenty times as slowly.
    low, high = rows.min(0).astype(np.int64), rows.max(0).astype(np.int64)
    sizes = high - low + 1
    packed = np.ravel_multi_index(tuple((rows - low).T), tuple(sizes))
    found, counts = np.unique(packed, return_counts=True)
    order = np.argsort(packed, kind="stable")
    ends = np.cumsum(counts)
    found = np.stack(np.unravel_index(found, tuple(sizes)), axis=-1) + low
    for row, members in zip(found, np.split(order, ends[:-1]), strict=True):
        yield kind_of(row), members


def batches(
    numbers: Int[np.ndarray, " rays"], tile: int, tiles_at_once: int
) -> Iterator[tuple[Int[np.ndarray, " some"], Int[np.ndarray, " filled"]]]:
    """As `tiles`, but many tiles at a time as long as there are enough."""
    whole = len(numbers) - len(numbers) % (tile * tiles_at_once)
    yield from tiles(numbers[:whole], tile * tiles_at_once)
    yield from tiles(numbers[whole:], tile)


def tiles(
    numbers: Int[np.ndarray, " rays"], tile: int
) -> Iterator[tuple[Int[np.ndarray, " some"], Int[np.ndarray, " filled"]]]:
    """So many numbers at a time, and the same filled up with copies of the last one.

    What is filled up is compiled for two sizes only, of which few rays get the small.
    """
    for start in range(0, len(numbers), tile):
        some = numbers[start : start + tile]
        size = tile if len(some) > tile // 16 else tile // 16
        yield some, np.concatenate([some, np.full(size - len(some), some[-1])])


def _air(scene: Scene) -> Shell:
    """The air that holds all cloud."""
    shells = [layer.cloud.shell for layer in scene.layers]
    if not shells:
        return Shell(0.0, 10e3)
    return Shell(min(s.bottom_m for s in shells), max(s.top_m for s in shells))
