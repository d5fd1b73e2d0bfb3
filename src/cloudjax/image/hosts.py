"""Images by several processes, each with a part of the rays: see `jax.distributed`."""

from typing import TypeVar

import jax
import numpy as np


Painted = TypeVar("Painted")


def own_part(rays: int) -> range:
    """Return the numbers of the rays that this process renders.

    Of few rays each process renders all.
    """
    if not _in_parts(rays):
        return range(rays)
    share = _share(rays)
    start = share * jax.process_index()
    return range(start, min(start + share, rays))


def together(painted: Painted, rays: int) -> Painted:
    """Put the parts of all processes together; each gets the whole.

    **Arguments:** `painted`: a pytree of host arrays, whose last axis is the rays of
    `own_part`.
    """
    if not _in_parts(rays):
        return painted
    return jax.tree.map(lambda leaf: _gathered(leaf, rays), painted)


def _in_parts(rays: int) -> bool:
    # Nobody's part is empty.
    return 1 < jax.process_count() <= rays // jax.process_count()


def _share(rays: int) -> int:
    return -(-rays // jax.process_count())


def _gathered(leaf: np.ndarray, rays: int) -> np.ndarray:
    from jax.experimental.multihost_utils import process_allgather

    # All processes bring arrays of one shape.
    filled = np.zeros((*leaf.shape[:-1], _share(rays)), leaf.dtype)
    filled[..., : leaf.shape[-1]] = leaf
    every = np.moveaxis(np.asarray(process_allgather(filled)), 0, -2)
    return every.reshape(*leaf.shape[:-1], -1)[..., :rays]
