"""Whole images: rays sorted by their pixels' footprints, marched tile by tile.

The tiles are a loop on the host around two compiled functions. In one piece XLA would
fuse the reads of textures into all that uses them, and repeat them; within `lax.map` a
CPU would give each operation one core only.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Float, Int

from .footprint import Footprint, Kind, kind_of, kinds
from .rays import Rays
from .scene import BandRadiances, Sampled, Scene, join, navigate, sample
from .shell import Shell
from .transfer import CloudProducts, products, radiances


# Radiances without cloud of the rays of these numbers.
Background = Callable[[Int[np.ndarray, " rays"]], BandRadiances]
# The lines of sight of the rays of these numbers.
Sight = Callable[[Int[np.ndarray, " rays"]], Rays]

_sample = eqx.filter_jit(sample)
_SORTED_AT_ONCE = 1 << 18


@dataclass(frozen=True, eq=False)
class Weather:
    """What masks, moves and warms the clouds of a scene.

    **Fields:** `masks`, `displacements`, `temperature`: as `navigate` takes them.
    """

    masks: Sequence | None = None
    displacements: Sequence | None = None
    temperature: Callable | None = None


CALM = Weather()


@dataclass(frozen=True, eq=False)
class Image:
    """All rays of a sensor, rendered.

    **Fields:** `radiances`, `clouds`: host arrays, in the order of the rays; no
    `clouds` where not asked.
    """

    radiances: BandRadiances
    clouds: CloudProducts | None


def render(
    scene: Scene,
    sight: Rays | Sight,
    sun_direction: Float[np.ndarray, "3"],
    background: Background,
    weather: Weather = CALM,
    *,
    rays: int | None = None,
    resolution: int = 128,
    tile: int = 2048,
    with_products: bool = False,
    on_tile: Callable[[int, int], None] | None = None,
) -> Image:
    """March all rays, a tile that fits the cache at a time.

    The result does not depend on `tile`.

    **Arguments:**

    - `sight`: the rays, or a function that makes those of given numbers, for images
      whose rays do not fit into memory; then `rays` is their number.
    - `sun_direction`: unit vector from the Earth to the sun, ECEF.
    - `background`: what is seen without cloud.
    - `resolution`: voxels per axis of the textures.
    - `with_products`: the clouds' cover, height, depth and class, too.
    - `on_tile`: called with the numbers of rays done and of all.
    """
    count = len(sight) if isinstance(sight, Rays) else rays
    if count is None:
        raise ValueError(
            "Give the number of rays along with a function that makes them."
        )
    look = _look_with_products if with_products else _look
    leaves: list[np.ndarray] = []
    tree: Any = None
    pending: list = []
    done = 0

    def store(index, seen):
        nonlocal tree
        parts, tree = jax.tree.flatten(seen)
        if not leaves:
            leaves.extend(np.empty((*p.shape[:-1], count), p.dtype) for p in parts)
        for whole, part in zip(leaves, parts, strict=True):
            whole[..., index] = np.asarray(part)[..., : len(index)]

    for kind, textures, index, filled in _tiles(scene, sight, count, resolution, tile):
        view = navigate(
            scene,
            _some(sight, filled),
            sun_direction,
            weather.masks,
            weather.displacements,
            weather.temperature,
            knots=kind.knots,
            twice=kind.twice,
        )
        sampled = _sample(scene, view, textures)
        pending.append((index, look(scene, sampled, background(filled))))
        # One tile is navigated on the host while the device works on the one before.
        if len(pending) > 1:
            store(*pending.pop(0))
        done += len(index)
        if on_tile is not None:
            on_tile(done, count)
    for item in pending:
        store(*item)
    seen, clouds = jax.tree.unflatten(tree, leaves)
    return Image(seen, clouds)


def sample_rays(
    scene: Scene,
    rays: Rays,
    sun_direction: Float[np.ndarray, "3"],
    weather: Weather = CALM,
    *,
    resolution: int = 128,
    tile: int = 2048,
) -> Sampled:
    """Samples along all rays in their own order, for work on the parameters.

    Rays that graze the Earth are followed into a shell once.
    """
    parts, order = [], []
    for _, textures, index, filled in _tiles(
        scene, rays, len(rays), resolution, tile, alike=True
    ):
        view = navigate(
            scene,
            rays[filled],
            sun_direction,
            weather.masks,
            weather.displacements,
            weather.temperature,
        )
        part = _sample(scene, view, textures)
        parts.append(_first(part, len(index)))
        order.append(index)
    return _first(join(parts), np.argsort(np.concatenate(order)))


def _look(scene, sampled, background):
    return _radiances(scene, sampled, background), None


def _look_with_products(scene, sampled, background):
    return _radiances(scene, sampled, background), _products(scene, sampled)


_radiances = eqx.filter_jit(radiances)
_products = eqx.filter_jit(products)


def _first(sampled: Sampled, index) -> Sampled:
    """Some rays of a set: so many, or those of an index."""
    pick = slice(index) if isinstance(index, int) else index
    bare = eqx.tree_at(lambda s: s.sun_direction, sampled, None)
    some = jax.tree.map(lambda x: x[:, pick] if x.ndim == 3 else x[pick], bare)
    return eqx.tree_at(
        lambda s: s.sun_direction,
        some,
        sampled.sun_direction,
        is_leaf=lambda x: x is None,
    )


def _some(sight: Rays | Sight, index) -> Rays:
    return sight[index] if isinstance(sight, Rays) else sight(index)


def _tiles(
    scene: Scene,
    sight: Rays | Sight,
    count: int,
    resolution: int,
    tile: int,
    *,
    alike: bool = False,
) -> Iterator[tuple[Kind, tuple, Int[np.ndarray, " rays"], Int[np.ndarray, " tile"]]]:
    """Kind, textures, and numbers of the rays of each tile, also filled up to its size.

    Copies of the last ray fill a tile up, so that one compilation serves. With
    `alike`, kinds that differ in their footprint only are told apart.
    """
    rows = np.concatenate(
        [
            kinds(_some(sight, np.arange(start, min(start + _SORTED_AT_ONCE, count))),
                  _air(scene)).astype(np.int16)
            for start in range(0, count, _SORTED_AT_ONCE)
        ]
    )  # fmt: skip
    if alike:
        rows[:, 5:] = 2, 0
    found, kind_of_ray = np.unique(rows, axis=0, return_inverse=True)
    tile = min(tile, max(count, 1))
    order = np.argsort(kind_of_ray, kind="stable")
    ends = np.cumsum(np.bincount(kind_of_ray.reshape(-1), minlength=len(found)))
    for row, members in zip(found, np.split(order, ends[:-1]), strict=True):
        kind = kind_of(row.astype(np.int64))
        textures = _textures(scene, kind.footprint, resolution)
        for start in range(0, len(members), tile):
            index = members[start : start + tile]
            last = np.full(tile - len(index), index[-1])
            yield kind, textures, index, np.concatenate([index, last])


def _textures(scene: Scene, footprint: Footprint, resolution: int) -> tuple:
    return tuple(
        layer.cloud.make_textures(footprint, resolution) for layer in scene.layers
    )


def _air(scene: Scene) -> Shell:
    """The air that holds all cloud."""
    shells = [layer.cloud.shell for layer in scene.layers]
    if not shells:
        return Shell(0.0, 10e3)
    return Shell(min(s.bottom_m for s in shells), max(s.top_m for s in shells))
