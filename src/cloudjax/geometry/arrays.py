"""Arrays of the host are numpy's, or what JAX puts in their place when it compiles."""

from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np


if TYPE_CHECKING:
    # Numpy to all who call; only `compiled_for_many` passes others.
    HostArray = np.ndarray
else:
    HostArray = Any


def namespace(x: HostArray) -> ModuleType:
    """Return the module whose functions work on an array: numpy or jax.numpy."""
    return x.__array_namespace__() if hasattr(x, "__array_namespace__") else np
