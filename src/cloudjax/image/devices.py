"""All devices work, each on its share of the rays.

No ray knows of another, so devices tell each other nothing until all have ended.
"""

from collections.abc import Callable
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh, NamedSharding, PartitionSpec

from cloudjax.march.view import Surroundings, View


Seen = TypeVar("Seen")
_RAYS = "rays"


def device_count() -> int:
    """Return how many devices this process has."""
    return jax.local_device_count()


def spread(view: View) -> View:
    """Spread the rays of a view over all devices of this process.

    `radiances` of the view then run on all of them.

    **Arguments:** `view`: of a number of rays that the number of devices divides.

    **Raises:** `ValueError` for another number of rays.
    """
    mesh = _mesh(jax.local_devices())
    return jax.device_put(view, NamedSharding(mesh, PartitionSpec(_RAYS)))


def shared_out(
    function: Callable[[Any, Any], Seen], common: Any, view: View | Surroundings
) -> Seen:
    """Call a function of a view, each device of this process for its share of the rays.

    **Arguments:** `function`: of `common`, which all devices have whole, and of a view;
    its results have the rays as last axis of every leaf.
    """
    return _shared_out(function, common, view, jax.local_devices())


def shared_by_all(
    function: Callable[[Any, Any], Seen], common: Any, view: View
) -> Seen:
    """Call a function as `shared_out`, with the devices of all processes.

    All of them must come here with the same arguments, of any number of rays, and each
    gets the whole result.
    """
    devices = jax.devices()
    if len(devices) == 1:
        return function(common, view)
    count = len(view)
    # Filled up: each device has as many.
    rays = jnp.arange(-(-count // len(devices)) * len(devices)) % count
    seen = _shared_out(function, common, view[rays], devices)
    everywhere = NamedSharding(_mesh(devices), PartitionSpec())
    return jax.tree.map(
        lambda leaf: jax.lax.with_sharding_constraint(leaf, everywhere)[..., :count],
        seen,
    )


def _shared_out(function, common, view, devices):
    if len(devices) == 1:
        return function(common, view)
    last = jax.tree.map(
        lambda leaf: PartitionSpec(*[None] * (leaf.ndim - 1), _RAYS),
        jax.eval_shape(function, common, view),
    )
    # Unchecked: what varies along the rays is told by the specs alone.
    return jax.shard_map(
        function,
        mesh=_mesh(devices),
        in_specs=(PartitionSpec(), PartitionSpec(_RAYS)),
        out_specs=last,
        check_vma=False,
    )(common, view)


def _mesh(devices) -> Mesh:
    return Mesh(np.array(devices), (_RAYS,))
