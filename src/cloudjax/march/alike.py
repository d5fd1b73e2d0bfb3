"""What is done to every way alike is compiled once, and skipped where it meets nothing.

If each way had code of its own, XLA would take six seconds for the networks of light of
each.
"""

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float


# Whether any ray meets the cloud of a way. It is True for a single ray, which is one of
# many under `jax.vmap`: all of these are computed, whatever each of them meets.
Met = Bool[Array, ""] | bool

_In = TypeVar("_In")
_Out = TypeVar("_Out")


def any_met(share: Float[Array, " rays"]) -> Met:
    """Tell whether any ray meets a way's cloud."""
    return True if share.shape == (1,) else (share > 0).any()


def each_met(
    met: Sequence[Met],
    found: Callable[[_In], _Out],
    missed: Callable[[_In], _Out],
    items: Sequence[_In],
) -> list[_Out]:
    """Find something of each item, one after the other; those of one shape are compiled
    once.

    **Arguments:** `met`: whether any ray meets the cloud of an item; elsewhere `missed`
    says what holds.
    """

    if any(some is True for some in met):
        return [found(item) for item in items]

    def one(both):
        return jax.lax.cond(both[0], found, missed, both[1])

    groups: dict[Any, list[int]] = {}
    for i, item in enumerate(items):
        groups.setdefault(_form(item), []).append(i)
    results: dict[int, _Out] = {}
    for members in groups.values():
        some = [(met[i], items[i]) for i in members]
        if len(members) == 1:
            results[members[0]] = one(some[0])
            continue
        together = jax.lax.map(one, jax.tree.map(lambda *x: jnp.stack(x), *some))
        for place, i in enumerate(members):
            results[i] = jax.tree.map(lambda x, at=place: x[at], together)
    return [results[i] for i in range(len(items))]


def if_met(
    met: Met,
    found: Callable[..., _Out],
    missed: Any,
    *operands: Any,
) -> _Out:
    """Find something where cloud is met, and compute nothing elsewhere.

    **Arguments:** `missed`: what holds there, one number for each array.
    """
    if met is True:
        return found(*operands)
    shapes = jax.eval_shape(found, *operands)

    def nothing(*_: Any) -> _Out:
        return jax.tree.map(
            lambda x, one: jnp.full(x.shape, one, x.dtype), shapes, missed
        )

    return found_or_missed(met, found, nothing, *operands)


def found_or_missed(
    met: Met,
    found: Callable[..., _Out],
    missed: Callable[..., _Out],
    *operands: Any,
) -> _Out:
    """Find something where cloud is met; elsewhere `missed` says what holds."""
    if met is True:
        return found(*operands)
    return jax.lax.cond(met, found, missed, *operands)


def nothing_like(function: Callable[[_In], _Out], item: _In) -> _Out:
    """Make zeros of the shapes that a function finds."""
    shapes = jax.eval_shape(function, item)
    return jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), shapes)


def _form(item: Any) -> Any:
    leaves, structure = jax.tree.flatten(item)
    return structure, tuple((x.shape, x.dtype) for x in leaves)
