"""All devices of a host, each with its share of the rays.

No ray knows of another, so devices tell each other nothing.
"""

from collections.abc import Callable
from typing import Any, TypeVar

import jax
import numpy as np
from jax.sharding import Mesh, NamedSharding, PartitionSpec

from cloudjax.march.scene import Scene
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
    return jax.device_put(view, NamedSharding(_mesh(), PartitionSpec(_RAYS)))


def shared_out(
    function: Callable[[Scene, Any], Seen], scene: Scene, view: View | Surroundings
) -> Seen:
    """Call a function of a scene and a view, each device for its share of the rays.

    **Arguments:** `function`: its results have the rays as last axis of every leaf.
    """
    if device_count() == 1:
        return function(scene, view)
    last = jax.tree.map(
        lambda leaf: PartitionSpec(*[None] * (leaf.ndim - 1), _RAYS),
        jax.eval_shape(function, scene, view),
    )
    # Unchecked: what varies along the rays is told by the specs alone.
    return jax.shard_map(
        function,
        mesh=_mesh(),
        in_specs=(PartitionSpec(), PartitionSpec(_RAYS)),
        out_specs=last,
        check_vma=False,
    )(scene, view)


def _mesh() -> Mesh:
    return Mesh(np.array(jax.local_devices()), (_RAYS,))
