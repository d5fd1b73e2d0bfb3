"""Pictures are put together from tiles."""

from dataclasses import dataclass, field
from typing import Any

import jax
import numpy as np
from jaxtyping import Int


@dataclass(eq=False)
class Canvas:
    """Host arrays for all rays, made when it is known of what."""

    rays: int
    leaves: list[np.ndarray] = field(default_factory=list)
    tree: Any = None

    def paint(self, index: Int[np.ndarray, " rays"], seen) -> None:
        """Put the first rays of `seen` at places; what has no place is left out."""
        parts, self.tree = jax.tree.flatten(seen)
        if not self.leaves:
            shapes = [(*part.shape[:-1], self.rays) for part in parts]
            self.leaves = [
                np.empty(shape, part.dtype)
                for shape, part in zip(shapes, parts, strict=True)
            ]
        for whole, part in zip(self.leaves, parts, strict=True):
            whole[..., index] = np.asarray(part)[..., : len(index)]

    @property
    def painted(self):
        """Give what has been painted, put together as each part was."""
        return jax.tree.unflatten(self.tree, self.leaves)
