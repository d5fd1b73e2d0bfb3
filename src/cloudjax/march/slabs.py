"""Light in the slabs of cloud of each ray is found where there is cloud.

Of the slabs of a tile, one for each way, node and ray, four out of five are empty. The
others are brought together, and networks are evaluated for them alone.
"""

import functools as ft
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, Float

from cloudjax.light.reflection import Scatterers

from .alike import nothing_like


# A strategy finds something in one band, elementwise, from optical depths [nodes rays],
# particles, and what is known of each ray, [rays] or [nodes rays].
Strategy = Callable[[Float[Array, "nodes rays"], Scatterers, Any], Any]
# Slabs of a smaller optical depth are empty.
_LEAST_DEPTH = 1e-6
# Slabs that are evaluated at once by a core of a CPU.
_AT_ONCE = 1024


def in_slabs(
    strategy: Strategy,
    depth: Float[Array, "bands nodes rays"],
    particles: Scatterers,
    rays: Any,
    empty: Any,
) -> Any:
    """Find what a strategy says of each slab, in all bands, [bands nodes rays].

    Derivatives are those of the strategy in empty slabs, too: clear air may become
    cloud.

    **Arguments:** `depth`: optical depths; `rays`: what is known of each ray; `empty`:
    what holds of slabs without cloud.
    """
    return _in_slabs(strategy, (depth, particles, rays), empty)


@jax.custom_jvp
def _in_slabs(strategy: Strategy, slabs: tuple, empty: Any):
    depth = slabs[0]
    # A device of many cores evaluates all slabs in the time of some.
    if depth[0].size <= _AT_ONCE or jax.default_backend() != "cpu":
        return each_band(strategy)(*slabs)
    return _where_filled(each_band(strategy), slabs, empty)


def _derivative(primals, tangents):
    leaves, structure = jax.tree.flatten(primals[:2])
    changes = jax.tree.leaves(tangents[:2])
    moved = [i for i, x in enumerate(changes) if not isinstance(x, SymbolicZero)]

    def found(*some):
        given = dict(zip(moved, some, strict=True))
        every = [given.get(i, leaf) for i, leaf in enumerate(leaves)]
        strategy, slabs = jax.tree.unflatten(structure, every)
        return each_band(strategy)(*slabs)

    return jax.jvp(found, [leaves[i] for i in moved], [changes[i] for i in moved])


_in_slabs.defjvp(_derivative, symbolic_zeros=True)  # pyright: ignore[reportFunctionMemberAccess]


def each_band(strategy: Strategy) -> Callable[..., Any]:
    """Make a strategy work on all bands at once, so that it is compiled once."""
    return jax.vmap(strategy, in_axes=(0, 0, None))


def _where_filled(function: Callable[..., Any], slabs: tuple, empty: Any):
    """Evaluate a function of slabs where they hold cloud; elsewhere `empty` holds."""
    depth, particles, rays = slabs
    bands, _, count = depth.shape
    flat = depth.reshape(bands, -1)
    filled = (flat > _LEAST_DEPTH).any(0)
    total, blocks = filled.sum(), -(-filled.size // _AT_ONCE)
    (every,) = jnp.nonzero(filled, size=blocks * _AT_ONCE, fill_value=0)

    def some(index):
        known = jax.tree.map(
            lambda x: x[index % count] if x.ndim == 1 else x.reshape(1, -1)[:, index],
            rays,
        )
        return function(flat[:, None, index], particles, known)

    def block(numbered):
        number, index = numbered
        nothing = ft.partial(nothing_like, some)
        return jax.lax.cond(number * _AT_ONCE < total, some, nothing, index)

    found = jax.lax.map(block, (jnp.arange(blocks), every.reshape(blocks, -1)))
    place = jnp.cumsum(filled) - 1

    def spread(part, none):
        whole = jnp.moveaxis(part[:, :, 0], 0, 1).reshape(bands, -1)[:, place]
        return jnp.where(filled, whole, none.reshape(bands, -1)).reshape(depth.shape)

    return jax.tree.map(spread, found, empty)
