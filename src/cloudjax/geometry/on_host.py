"""Geometry of many rays is compiled for the host, in double precision.

The same functions work on the arrays of numpy and of JAX. Numpy needs ten times as long
for many rays; for few, to compile takes longer than they do. What follows from places
and need not be so exact is compiled likewise, for the device.
"""

import functools as ft
from collections.abc import Callable
from typing import TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from .rays import GroundPoints, Rays
from .shells import Chords


_F = TypeVar("_F", bound=Callable)
# Rays from which on they are many.
_MANY = 8192


# Here, for what reads files knows lines of sight and not JAX.
for _kind in (Rays, GroundPoints, Chords):
    jax.tree_util.register_dataclass(_kind)


def compiled_for_many(
    *static: str, exact: bool = True, handed_over: bool = False
) -> Callable[[_F], _F]:
    """Compile a function of many rays, in float64 for the host; its results are numpy.

    Its first argument are the rays, or what is known of each.

    **Arguments:**

    - `static`: names of the arguments that are no arrays.
    - `exact`: False for the device, in the precision that JAX runs with.
    - `handed_over`: True where the results go to the device, so that they are brought
      to its precision while they are in the cache.
    """

    def wrap(function: _F) -> _F:
        @ft.cache
        def compiled_in(precision):
            @ft.wraps(function)
            def narrowed(*given, **named):
                found = function(*given, **named)
                return jax.tree.map(ft.partial(_in, precision), found)

            return jax.jit(narrowed, static_argnames=static)

        @ft.wraps(function)
        def called(rays, *others, **named):
            first = jax.tree.leaves(rays)[0]
            if isinstance(first, Tracer) or len(first) < _MANY:
                return function(rays, *others, **named)
            if not exact:
                return compiled_in(None)(rays, *others, **named)
            precision = jnp.result_type(float) if handed_over else None
            cpu = jax.local_devices(backend="cpu")[0]
            with jax.enable_x64(True), jax.default_device(cpu):
                found = compiled_in(precision)(rays, *others, **named)
            # What is on its way to the device may be there already.
            there = handed_over and jax.default_backend() == "cpu"
            return found if there else jax.tree.map(np.asarray, found)

        return called  # pyright: ignore[reportReturnType]

    return wrap


def _in(precision, x):
    """Numbers that are no integers, in a precision; None leaves them as they are."""
    floating = jnp.issubdtype(x.dtype, jnp.floating)
    return x if precision is None or not floating else x.astype(precision)
