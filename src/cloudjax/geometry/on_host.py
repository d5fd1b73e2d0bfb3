"""Geometry of many rays is compiled for the host, in double precision.

The same functions work on the arrays of numpy and of JAX. Numpy needs ten times as long
for many rays; for few, to compile takes longer than they do. What follows from places
and need not be so exact is compiled likewise, for the device.
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


def compiled_for_many(*static: str, exact: bool = True) -> Callable[[_F], _F]:
    """Compile a function of many rays, in float64 for the host; its results are numpy.

    Its first argument are the rays, or what is known of each.

    **Arguments:** `static`: names of the arguments that are no arrays. `exact`: False
    for the device, in the precision that JAX runs with.
    """

    def wrap(function: _F) -> _F:
        compiled = jax.jit(function, static_argnames=static)

        @ft.wraps(function)
        def called(rays, *others, **named):
            first = jax.tree.leaves(rays)[0]
            if not isinstance(first, np.ndarray) or len(first) < _MANY:
                return function(rays, *others, **named)
            if not exact:
                return compiled(rays, *others, **named)
            cpu = jax.local_devices(backend="cpu")[0]
            with jax.enable_x64(True), jax.default_device(cpu):
                found = compiled(rays, *others, **named)
            return jax.tree.map(np.asarray, found)

        return called  # pyright: ignore[reportReturnType]

    return wrap
