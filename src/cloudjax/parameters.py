"""A parameter of a scene has a path, such as "layers.low_stratus.extinction_per_m".

A path is the way of attributes from the scene to an array: layers by their name,
elements of an array by index, as in "reflective.gain.0". It may begin with a layer's
name: "low_stratus.cloud.function.threshold". Unlike a function that finds the array, a
path can be compared, hashed, pickled and written to a file.
"""

import difflib
from collections.abc import Iterator, Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from cloudjax.march.scene import Scene


LAYERS = "layers"
# Elements of longer or higher arrays are not listed; all can be named.
_LISTED = 16


def paths(scene: Scene) -> list[str]:
    """List the paths of all numbers: arrays, and the elements of short ones."""
    return list(_paths(scene))


def value_at(scene: Scene, path: str) -> Float[Array, "..."]:
    """Return the array or the element at a path.

    **Raises:** `ValueError` for a path that the scene has not, with the nearest one.
    """
    keys, index = _resolve(scene, path)
    whole = jnp.asarray(_at(scene, keys))
    return whole[index] if index else whole


def put(scene: Scene, values: Mapping[str, ArrayLike]) -> Scene:
    """Return the scene with the numbers at some paths changed.

    Values may be tracers: `jit`, `grad` and `vmap` go through. Each is brought to the
    type of the array that it is put into.

    **Raises:** `ValueError` for a path that the scene has not, with the nearest one.
    """
    changed: dict[tuple, Any] = {}
    for path, value in values.items():
        keys, index = _resolve(scene, path)
        old = jnp.asarray(changed[keys] if keys in changed else _at(scene, keys))
        new = jnp.asarray(value, old.dtype)
        shape = old[index].shape if index else old.shape
        if new.shape != shape:
            raise ValueError(
                f"{path} has the shape {shape}, and the value for it {new.shape}: give "
                "one of its shape."
            )
        changed[keys] = old.at[index].set(new) if index else new
    return eqx.tree_at(
        lambda s: [_at(s, keys) for keys in changed], scene, list(changed.values())
    )


def _resolve(scene: Scene, path: str) -> tuple[tuple, tuple[int, ...]]:
    """Split a path into keys down to an array and the index of an element in it."""
    names = [layer.name for layer in scene.layers]
    parts = path.split(".")
    if parts[0] in names:
        parts = [LAYERS, *parts]
    node: Any = scene
    keys, index = [], []
    for part in parts:
        key = _key(node, part, names)
        if key is None:
            raise _unknown(scene, path)
        if _is_numbers(node):
            index.append(key)
            node = np.empty(np.shape(node)[1:])
        else:
            keys.append(key)
            node = node[key] if isinstance(key, int) else getattr(node, key)
    if not _is_numbers(node):
        raise _unknown(scene, path)
    return tuple(keys), tuple(index)


def _key(node: Any, part: str, names: list[str]) -> str | int | None:
    """Find what to take of a node; None where there is no such thing."""
    if _is_numbers(node):
        length = np.shape(node)[0] if np.ndim(node) else 0
        return _index(part, length)
    if isinstance(node, tuple | list):
        # Layers are the one tuple whose members have names.
        layers = [getattr(member, "name", None) for member in node] == names
        if layers and part in names:
            return names.index(part)
        return _index(part, len(node))
    known = isinstance(node, eqx.Module) and part in _dynamic(node)
    return part if known else None


def _index(part: str, length: int) -> int | None:
    return int(part) if part.isdecimal() and int(part) < length else None


def _dynamic(module: eqx.Module) -> list[str]:
    """The fields of a module that are leaves or hold some."""
    fields = module.__dataclass_fields__
    return [name for name, f in fields.items() if not f.metadata.get("static", False)]


def _at(scene: Scene, keys: tuple) -> Any:
    node: Any = scene
    for key in keys:
        node = node[key] if isinstance(key, int) else getattr(node, key)
    return node


def _is_numbers(node: Any) -> bool:
    if isinstance(node, bool):
        return False
    return isinstance(node, int | float) or eqx.is_array_like(node)


def _paths(scene: Scene) -> Iterator[str]:
    for keys, leaf in jax.tree_util.tree_leaves_with_path(scene):
        parts = [_name(key) for key in keys]
        if parts[0] == LAYERS:
            parts[1] = scene.layers[int(parts[1])].name
        path = ".".join(parts)
        yield path
        if np.ndim(leaf) == 1 and np.size(leaf) <= _LISTED:
            yield from (f"{path}.{i}" for i in range(np.size(leaf)))


def _name(key: Any) -> str:
    """Of one of jax's own keys."""
    return str(getattr(key, "name", getattr(key, "idx", getattr(key, "key", key))))


def _unknown(scene: Scene, path: str) -> ValueError:
    known = paths(scene)
    short = [p.removeprefix(f"{LAYERS}.") for p in known]
    near = difflib.get_close_matches(path, [*known, *short], n=1, cutoff=0.0)[0]
    return ValueError(
        f"The scene has no parameter {path!r}: the nearest one is {near!r}."
    )
