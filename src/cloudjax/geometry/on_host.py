"""Geometry of many rays is compiled for the host, in double precision.

The same functions work on the arrays of numpy and of JAX. Numpy needs ten times as long
for many rays; for few, to compile takes longer than they do.
"""

import functools as ft
from collections.abc import Callable
from typing import TypeVar

import jax
import numpy as np

from .rays import GroundPoints, Rays
from .shells import Chords


_F = TypeVar("_F", bound=Callable)
# Rays from which on they are many.
_MANY = 8192


# Here, for what reads files knows lines of sight and not JAX.
for _kind in (Rays, GroundPoints, Chords):
    jax.tree_util.register_dataclass(_kind)


def compiled_for_many(*static: str) -> Callable[[_F], _F]:
    """Compile a function of many rays, in float64 for the host; its results are numpy.

    **Arguments:** `static`: names of the arguments that are no arrays.
    """

    def wrap(function: _F) -> _F:
        compiled = jax.jit(function, static_argnames=static)

        @ft.wraps(function)
        def called(rays, *others, **named):
            if len(rays) < _MANY or not isinstance(rays.direction, np.ndarray):
                return function(rays, *others, **named)
            cpu = jax.local_devices(backend="cpu")[0]
            with jax.enable_x64(True), jax.default_device(cpu):
                found = compiled(rays, *others, **named)
            return jax.tree.map(np.asarray, found)

        return called  # pyright: ignore[reportReturnType]

    return wrap
