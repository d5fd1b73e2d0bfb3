"""Whole images: rays sorted by their pixels' footprints, marched tile by tile.

The tiles are a loop on the host around two compiled functions, for in one piece XLA
would fuse the reads of textures into all that uses them, and repeat them. A tile fits
the cache, which is too little work for several cores to share: each core has its own.
"""

import functools as ft
import operator as op
import os
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .footprint import Kind
from .rays import Rays
from .scene import BandRadiances, Sampled, Scene, View, join, navigate, sample
from .tiling import Sight, batches, some_rays, sorted_by_kind, tiles
from .transfer import CloudProducts, clear_products, products, radiances


# Radiances without cloud of the rays of these numbers.
Background = Callable[[Int[np.ndarray, " rays"]], BandRadiances]

# Tiles that are navigated at once: numpy and XLA have a price per call.
_TILES_AT_ONCE = 8
# Rays that meet cloud less often are clear. Masks leave clear air a chance of 1e-4
# (`fraction_to_mask`); cover is wrong by this at most.
LEAST_LIKELIHOOD = 1e-3


@dataclass(frozen=True, eq=False)
class Weather:
    """What masks, moves and warms the clouds of a scene.

    **Fields:** `masks`, `displacements`, `temperature`, `profile`: as `navigate` takes
    them.
    """

    masks: Sequence | None = None
    displacements: Sequence | None = None
    temperature: Callable | None = None
    profile: Callable | None = None


CALM = Weather()


@dataclass(frozen=True, eq=False)
class Image:
    """All rays of a sensor, rendered.

    **Fields:** `radiances`, `clouds`: host arrays, in the order of the rays; no
    `clouds` where not asked.
    """

    radiances: BandRadiances
    clouds: CloudProducts | None


@dataclass(frozen=True, eq=False)
class _Batch:
    """Rays of one kind, laid through the layers.

    **Fields:**

    - `textures`, `view`: of the rays; None where they miss all air.
    - `background`: behind them.
    - `index`: their numbers, those of the first rays of `view`.
    """

    textures: tuple | None
    view: View | None
    background: BandRadiances
    index: Int[np.ndarray, " rays"]


# Work that makes a batch, on whatever core is free.
_Job = Callable[[], _Batch]


@dataclass(frozen=True, eq=False)
class Prepared:
    """An image all but for its march, for many renders of one view.

    Navigation, masks, winds, background and textures are done.
    """

    batches: tuple[_Batch, ...]
    rays: int
    tile: int

    def render(self, scene: Scene, *, with_products: bool = False) -> Image:
        """March a scene that differs from the prepared one in its parameters only."""
        jobs = (lambda batch=batch: batch for batch in self.batches)
        return _march(scene, jobs, self.rays, self.tile, with_products)


def prepare(
    scene: Scene,
    sight: Rays | Sight,
    sun_direction: Float[np.ndarray, "3"],
    background: Background,
    weather: Weather = CALM,
    *,
    rays: int | None = None,
    resolution: int = 128,
    tile: int | None = None,
) -> Prepared:
    """Everything of an image that may be done once; arguments as for `render`."""
    count, tile = _count(sight, rays), tile or _default_tile()
    jobs = _jobs(
        scene, sight, count, sun_direction, background, weather, resolution, tile
    )
    return Prepared(tuple(_each(jobs, op.call)), count, tile)


def render(
    scene: Scene,
    sight: Rays | Sight,
    sun_direction: Float[np.ndarray, "3"],
    background: Background,
    weather: Weather = CALM,
    *,
    rays: int | None = None,
    resolution: int = 128,
    tile: int | None = None,
    with_products: bool = False,
    on_tile: Callable[[int, int], None] | None = None,
) -> Image:
    """March all rays, a tile that fits the cache at a time.

    The result does not depend on `tile`. Rays that hardly any cloud can be on show the
    background and are not marched.

    **Arguments:**

    - `sight`: the rays, or a function that makes those of given numbers, for images
      whose rays do not fit into memory; then `rays` is their number.
    - `sun_direction`: unit vector from the Earth to the sun, ECEF.
    - `background`: what is seen without cloud.
    - `resolution`: voxels per axis of the textures.
    - `tile`: rays that are marched at once.
    - `with_products`: the clouds' cover, height, depth and class, too.
    - `on_tile`: called with the numbers of rays done and of all.
    """
    count, tile = _count(sight, rays), tile or _default_tile()
    jobs = _jobs(
        scene, sight, count, sun_direction, background, weather, resolution, tile
    )
    return _march(scene, jobs, count, tile, with_products, on_tile)


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
    for kind, members in sorted_by_kind(scene, rays, len(rays), alike=True):
        textures = _make_textures(scene, kind, resolution)
        for index, filled in tiles(members, tile):
            view = _navigate(scene, rays[filled], sun_direction, weather, kind)
            part = _sample(scene, view, textures)
            parts.append(_pick(part, np.arange(len(index))))
            order.append(index)
    return _pick(join(parts), np.argsort(np.concatenate(order)))


def _march(scene, jobs, count, tile, with_products, on_tile=None) -> Image:
    look = _look_with_products if with_products else _look

    def unseen(behind: BandRadiances):
        if not with_products:
            return behind, None
        rays = jax.tree.leaves(behind)[0].shape[-1]
        return behind, clear_products(len(scene.layers), rays)

    def march(job: _Job) -> list:
        batch = job()
        if batch.view is None or batch.textures is None:
            return [(batch.index, unseen(batch.background))]
        chance = np.asarray(_likelihood(scene, batch.view))[: len(batch.index)]
        # Where no cloud is, the shadow of another may be.
        likely = (chance > LEAST_LIKELIHOOD) | (scene.shadows is not None)
        parts = [
            (batch.index[some], unseen(_pick(batch.background, filled)))
            for some, filled in tiles(np.flatnonzero(~likely), tile)
        ]
        for index, filled in tiles(np.flatnonzero(likely), tile):
            sampled = _sample(scene, _pick(batch.view, filled), batch.textures)
            seen = look(scene, sampled, _pick(batch.background, filled))
            parts.append((batch.index[index], seen))
        return parts

    canvas, done = _Canvas(count), 0
    for parts in _each(jobs, march):
        for index, seen in parts:
            canvas.paint(index, seen)
            done += len(index)
        if on_tile is not None:
            on_tile(done, count)
    return Image(*canvas.painted)


@dataclass(eq=False)
class _Canvas:
    """Host arrays for all rays, made when it is known of what."""

    rays: int
    leaves: list[np.ndarray] = field(default_factory=list)
    tree: Any = None

    def paint(self, index: Int[np.ndarray, " rays"], seen) -> None:
        """The first rays of `seen`, of which there may be more than numbers."""
        parts, self.tree = jax.tree.flatten(seen)
        if not self.leaves:
            shapes = [(*part.shape[:-1], self.rays) for part in parts]
            self.leaves = [
                np.empty(shape, part.dtype)
                for shape, part in zip(shapes, parts, strict=True)
            ]
        for whole, part in zip(self.leaves, parts, strict=True):
            whole[..., index] = np.asarray(part)[..., : len(index)]

    @property
    def painted(self):
        return jax.tree.unflatten(self.tree, self.leaves)


def _each(jobs: Iterable[_Job], work: Callable) -> Iterator:
    """Results in order, of as many jobs at once as there are cores, and one more."""
    workers = _workers()
    waiting: deque = deque()
    with ThreadPoolExecutor(workers) as pool:
        for job in jobs:
            waiting.append(pool.submit(work, job))
            if len(waiting) > workers:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()


def _workers() -> int:
    """Other devices than CPUs share out their work themselves."""
    if jax.default_backend() != "cpu":
        return 1
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 2


def _default_tile() -> int:
    return 4096 if jax.default_backend() == "cpu" else 1 << 17


# Compiled by jax and not by equinox, whose calls cost a millisecond with so many parts:
# all leaves are arrays.
@jax.jit
def _look(scene: Scene, sampled: Sampled, background: BandRadiances):
    return radiances(scene, sampled, background), None


@jax.jit
def _look_with_products(scene: Scene, sampled: Sampled, background: BandRadiances):
    # In one piece, so that the march is done once for both.
    return radiances(scene, sampled, background), products(scene, sampled)


_sample = jax.jit(sample)


@jax.jit
def _likelihood(scene: Scene, view: View) -> Float[Array, " rays"]:
    """Of the layer that a ray is most likely to meet."""
    chances = [
        scene.layers[i].cloud.likelihood(way)
        for i, way in zip(view.layer_of, view.ways, strict=True)
    ]
    return ft.reduce(jnp.maximum, chances)


_pick = jax.jit(op.getitem)


def _count(sight: Rays | Sight, rays: int | None) -> int:
    if isinstance(sight, Rays):
        return len(sight)
    if rays is None:
        raise ValueError(
            "Give the number of rays along with a function that makes them."
        )
    return rays


def _jobs(
    scene: Scene,
    sight: Rays | Sight,
    count: int,
    sun_direction: Float[np.ndarray, "3"],
    background: Background,
    weather: Weather,
    resolution: int,
    tile: int,
) -> Iterator[_Job]:
    def lay(kind: Kind, textures: Callable, index, filled) -> _Batch:
        rays = some_rays(sight, filled)
        view = _navigate(scene, rays, sun_direction, weather, kind)
        return _Batch(textures(), view, background(filled), index)

    def leave(index, filled) -> _Batch:
        return _Batch(None, None, background(filled), index)

    for kind, members in sorted_by_kind(scene, sight, count):
        textures = _once(_make_textures, scene, kind, resolution)
        work = ft.partial(lay, kind, textures) if kind.knots else leave
        for index, filled in batches(members, tile, _TILES_AT_ONCE):
            yield ft.partial(work, index, filled)


def _make_textures(scene: Scene, kind: Kind, resolution: int) -> tuple:
    """Those of each layer, averaged over a kind of pixel."""
    return tuple(
        layer.cloud.make_textures(kind.footprint, resolution) for layer in scene.layers
    )


def _once(work: Callable, *arguments) -> Callable:
    """Work for whichever thread needs its result first."""
    lock, results = threading.Lock(), []

    def result():
        with lock:
            if not results:
                results.append(work(*arguments))
        return results[0]

    return result


def _navigate(scene, rays, sun_direction, weather: Weather, kind: Kind) -> View:
    return navigate(
        scene,
        rays,
        sun_direction,
        weather.masks,
        weather.displacements,
        weather.temperature,
        weather.profile,
        knots=kind.knots,
        twice=kind.twice,
        footprint=kind.footprint,
    )
