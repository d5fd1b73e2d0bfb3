"""Whole images: rays sorted by their pixels' footprints, marched tile by tile.

The tiles are a loop on the host around two compiled functions, for in one piece XLA
would fuse the reads of textures into all that uses them, and repeat them. A tile fits
the cache, which is too little work for several cores to share: each core has its own.
"""

import functools as ft
import itertools
import operator as op
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from cloudjax.geometry.footprint import Footprint, Kind
from cloudjax.geometry.rays import Rays
from cloudjax.march.radiances import CloudProducts, clear_products, products, radiances
from cloudjax.march.scene import (
    BandRadiances,
    Sampled,
    Scene,
    View,
    join,
    navigate,
    sample,
)
from cloudjax.workers import each

from .canvas import Canvas
from .tiling import Sight, batches, some_rays, sorted_by_kind, tiles


# Radiances without cloud of the rays of these numbers.
Background = Callable[[Int[np.ndarray, " rays"]], BandRadiances]

# Tiles that are navigated at once: numpy and XLA have a price per call.
_TILES_AT_ONCE = 4
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
class _Tile:
    """Rays that are marched at once.

    **Fields:**

    - `index`: their numbers, those of the first rays of all else.
    - `samples`: finds those of a scene; None where no cloud can be.
    - `background`: behind them.
    """

    index: Int[np.ndarray, " rays"]
    samples: Callable[[Scene], Sampled] | None
    background: BandRadiances


@dataclass(frozen=True, eq=False)
class Prepared:
    """An image all but for its march, for many renders of one view.

    Navigation, masks, winds, background and textures are done, and the textures have
    been read: no parameter of the clouds moves a sample.
    """

    tiles: tuple[_Tile, ...]
    rays: int

    def render(self, scene: Scene, *, with_products: bool = False) -> Image:
        """March a scene that differs from the prepared one in its parameters only.

        Its layers may have fewer steps.
        """
        jobs = (lambda tile=tile: [tile] for tile in self.tiles)
        return _march(scene, jobs, self.rays, with_products)


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
    found = each(jobs, lambda job: list(_sampled_tiles(scene, job, tile)))
    return Prepared(tuple(itertools.chain.from_iterable(found)), count)


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
    likely = (ft.partial(_likely_tiles, scene, job, tile) for job in jobs)
    return _march(scene, likely, count, with_products, on_tile)


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
    every = list(sorted_by_kind(scene, rays, len(rays), alike=True))
    # All are read as often as the finest, or they could not be joined.
    finest = min((kind for kind, _ in every), key=lambda kind: kind.footprint.spacing_m)
    for kind, members in every:
        textures = _make_textures(scene, kind.footprint, resolution)
        for index, filled in tiles(members, tile):
            view = _navigate(scene, rays[filled], sun_direction, weather, finest)
            part = _sample(scene, view, textures)
            parts.append(_pick(part, np.arange(len(index))))
            order.append(index)
    return _pick(join(parts), np.argsort(np.concatenate(order)))


def _likely_tiles(scene: Scene, job: _Job, size: int) -> Iterator[_Tile]:
    """Of the rays that can meet cloud, and of the rest."""
    batch = job()
    chance = _chance(scene, batch)
    likely = chance > _least(scene)
    for some, filled in tiles(np.flatnonzero(~likely), size):
        yield _Tile(batch.index[some], None, _pick(batch.background, filled))
    for some, filled in tiles(np.flatnonzero(likely), size):
        view, behind = _pick(batch.view, filled), _pick(batch.background, filled)
        find = ft.partial(_sample, view=view, textures=batch.textures)
        yield _Tile(batch.index[some], find, behind)


def _sampled_tiles(scene: Scene, job: _Job, size: int) -> Iterator[_Tile]:
    """Of all rays, for scenes whose clouds may be anywhere."""
    batch = job()
    # Those alike together, so that whole tiles are clear.
    order = np.argsort(-_chance(scene, batch), kind="stable")
    for some, filled in tiles(order, size):
        find = None
        if batch.view is not None:
            view = _pick(batch.view, filled)
            find = ft.partial(_sample, view=view, textures=batch.textures)
            if scene.shadows is None:
                find = ft.partial(_same, find(scene))
        yield _Tile(batch.index[some], find, _pick(batch.background, filled))


def _least(scene: Scene) -> float:
    """Chance of cloud up to which rays are clear."""
    # Where no cloud is, the shadow of another may be.
    return LEAST_LIKELIHOOD if scene.shadows is None else -1.0


def _same(sampled: Sampled, scene: Scene) -> Sampled:
    """Whatever the parameters are."""
    return sampled


def _chance(scene: Scene, batch: _Batch) -> Float[np.ndarray, " rays"]:
    """That rays meet cloud."""
    count = len(batch.index)
    if batch.view is None:
        return np.full(count, -np.inf)
    return np.asarray(_likelihood(scene, batch.view.layer_of, batch.view.ways))[:count]


def _march(scene, jobs, count, with_products, on_tile=None) -> Image:
    def march(tiles: Callable[[], Iterable[_Tile]]) -> list:
        return [(tile.index, seen(tile)) for tile in tiles()]

    def seen(tile: _Tile):
        if tile.samples is None:
            return _unseen(scene, tile.background, with_products)
        return _look(
            scene,
            tile.samples(scene),
            tile.background,
            _least(scene),
            with_products=with_products,
        )

    canvas, done = Canvas(count), 0
    for parts in each(jobs, march):
        for index, part in parts:
            canvas.paint(index, part)
            done += len(index)
        if on_tile is not None:
            on_tile(done, count)
    return Image(*canvas.painted)


def _default_tile() -> int:
    return 8192 if jax.default_backend() == "cpu" else 1 << 17


def _unseen(scene: Scene, behind: BandRadiances, with_products: bool):
    """What rays without cloud see."""
    if not with_products:
        return behind, None
    rays = jax.tree.leaves(behind)[0].shape[-1]
    return behind, clear_products(len(scene.layers), rays)


# Compiled by jax and not by equinox, whose calls cost a millisecond with so many parts:
# all leaves are arrays.
@ft.partial(jax.jit, static_argnames="with_products")
def _look(
    scene: Scene,
    sampled: Sampled,
    background: BandRadiances,
    least: Float[Array, ""] | float,
    *,
    with_products: bool,
):
    """Radiances, and products in the same march, of rays that can meet cloud."""
    likely = _likelihood(scene, sampled.layer_of, sampled.clouds) > least
    clear = _unseen(scene, background, with_products)

    def look():
        found = products(scene, sampled) if with_products else None
        return radiances(scene, sampled, background), found

    seen = jax.lax.cond(likely.any(), look, lambda: clear)
    return jax.tree.map(lambda some, none: jnp.where(likely, some, none), seen, clear)


_sample = jax.jit(sample)


@ft.partial(jax.jit, static_argnames="layer_of")
def _likelihood(
    scene: Scene, layer_of: tuple[int, ...], ways: tuple
) -> Float[Array, " rays"]:
    """Of the layer that a ray is most likely to meet, from its ways or samples."""
    chances = [
        scene.layers[i].cloud.likelihood(way)
        for i, way in zip(layer_of, ways, strict=True)
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

    every = list(sorted_by_kind(scene, sight, count))
    with ThreadPoolExecutor(1) as ahead:
        textures: dict[Footprint, Future] = {}
        for i, (kind, members) in enumerate(every):
            # Those of the next kind are made while this one's rays are laid.
            near = [other.footprint for other, _ in every[i : i + 2] if other.knots]
            textures = {
                footprint: textures.get(footprint)
                or ahead.submit(_make_textures, scene, footprint, resolution)
                for footprint in near
            }
            work = leave
            if kind.knots:
                work = ft.partial(lay, kind, textures[kind.footprint].result)
            for index, filled in batches(members, tile, _TILES_AT_ONCE):
                yield ft.partial(work, index, filled)


def _make_textures(scene: Scene, footprint: Footprint, resolution: int) -> tuple:
    """Those of each layer, averaged over a kind of pixel."""
    return tuple(
        layer.cloud.make_textures(footprint, resolution) for layer in scene.layers
    )


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
