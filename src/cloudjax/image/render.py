"""Whole images are rendered by a loop over tiles of rays, around the pure functions.

Tiles are of rays that are read alike. In one piece XLA would fuse the reads of noise
into all that uses them, and repeat them. A tile fits the cache, which is too little
work for several cores to share: each core has its own.
"""

import functools as ft
import itertools
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from cloudjax.geometry.footprint import kinds
from cloudjax.geometry.rays import Rays, Sensor, lines_of_sight
from cloudjax.march.marched_way import shares_of_ways
from cloudjax.march.products import CloudProducts
from cloudjax.march.radiances import cloud_share, see, see_clear
from cloudjax.march.scene import BandRadiances, Scene
from cloudjax.march.view import (
    Surroundings,
    View,
    Ways,
    grouped_alike,
    lay,
    look_around,
    make_textures,
    require_concrete,
    sample,
    tiles,
)
from cloudjax.workers import each

from .canvas import Canvas
from .devices import device_count, shared_out
from .hosts import own_part, together
from .tiling import Sight, batches, some_rays


# Tiles that are navigated at once: numpy and XLA have a price per call.
_TILES_AT_ONCE = 4
# Rays of a tile that a core of a CPU marches at once.
_BLOCK = 2048
# Tiles in a job of one core, out of which those are taken that are read alike.
_TILES_IN_JOB = 16


@dataclass(frozen=True, eq=False)
class Image:
    """An `Image` has all rays of a sensor, rendered.

    **Fields:** `radiances`, `clouds`: host arrays, in the order of the rays; no
    `clouds` where not asked.
    """

    radiances: BandRadiances
    clouds: CloudProducts | None


@dataclass(frozen=True, eq=False)
class Tile:
    """Rays that are marched at once.

    **Fields:**

    - `index`: their numbers; the first rays of `view`, which may have more.
    - `view`: of the rays, or only what is around them where no cloud can be.
    """

    index: Int[np.ndarray, " rays"]
    view: View | Surroundings


@dataclass(frozen=True, eq=False)
class PreparedImage:
    """A `PreparedImage` has the views of a whole image, tile by tile, for many renders.

    No parameter of the clouds changes them.
    """

    tiles: tuple[Tile, ...]
    rays: int


def prepare(
    scene: Scene,
    sight: Rays | Sensor | Sight,
    sun_direction: Float[np.ndarray, "3"],
    *,
    rays: int | None = None,
    tile: int | None = None,
) -> PreparedImage:
    """Do once all work on an image that no parameter of the clouds changes.

    `render` takes the result in place of the rays; arguments as there. It holds the
    samples of all rays: some hundred bytes for each layer and ray.
    """
    require_concrete(scene, "prepare", "call it before jit, grad or vmap")
    sight, count = _counted(sight, rays)
    tile = _whole_tile(tile)
    jobs = _jobs(scene, sight, range(count), sun_direction, tile)
    found = each(
        jobs, lambda job: [t for b in job() for t in _sampled_tiles(scene, b, tile)]
    )
    return PreparedImage(tuple(itertools.chain.from_iterable(found)), count)


def render(
    scene: Scene,
    sight: Rays | Sensor | Sight | View | PreparedImage,
    sun_direction: Float[np.ndarray, "3"] | None = None,
    *,
    rays: int | None = None,
    tile: int | None = None,
    with_products: bool = False,
    on_tile: Callable[[int, int], None] | None = None,
) -> Image:
    """March all rays, a tile that fits the cache at a time.

    The result is that of `radiances` and `products` and does not depend on `tile`. Rays
    that hardly any cloud can be on are not marched. Of several processes that
    `jax.distributed` has brought together each renders a part of the rays, and all have
    the whole in the end; a view or a prepared image each renders by itself.

    **Arguments:**

    - `sight`: the rays; or a sensor that has some; or a function that makes the rays of
      given numbers, for images whose rays do not fit into memory, and then `rays` is
      their number; or a view or a prepared image, which know the sun.
    - `sun_direction`: unit vector from the Earth to the sun, ECEF.
    - `tile`: rays that are marched at once.
    - `with_products`: the clouds' cover, height, depth and class, too.
    - `on_tile`: called with the numbers of rays done and of all.

    **Raises:** `TypeError` for a scene of tracers, or where a sun is missing.
    """
    require_concrete(scene, "render", "make a view with `look` first")
    size = _whole_tile(tile)
    if isinstance(sight, View):
        count = len(sight)
        jobs = (ft.partial(_tiles_of, sight, size) for _ in range(1))
    elif isinstance(sight, PreparedImage):
        count = sight.rays
        jobs = (lambda one=one: [one] for one in sight.tiles)
    else:
        if sun_direction is None:
            raise TypeError("Rays need a sun: give `sun_direction`.")
        sight, count = _counted(sight, rays)
        part = own_part(count)
        jobs = (
            lambda job=job: (t for b in job() for t in _likely_tiles(scene, b, size))
            for job in _jobs(scene, sight, part, sun_direction, size)
        )
        painted = _march(scene, jobs, part, with_products, on_tile)
        return Image(*together(painted, count))
    return Image(*_march(scene, jobs, range(count), with_products, on_tile))


@dataclass(frozen=True, eq=False)
class _Batch:
    """Rays that are read alike, laid through the layers.

    **Fields:**

    - `index`: their numbers, those of the first rays of `ways`.
    - `ways`: or only what is around rays that miss all air.
    - `textures`: what the clouds are read from.
    """

    index: Int[np.ndarray, " rays"]
    ways: Ways | Surroundings
    textures: tuple


# Work that makes batches, on whatever core is free.
_Job = Callable[[], Iterator[_Batch]]


def _tiles_of(view: View, size: int) -> Iterator[Tile]:
    for index, filled in tiles(np.arange(len(view)), size):
        yield Tile(index, _pick(view, filled))


def _likely_tiles(scene: Scene, batch: _Batch, size: int) -> Iterator[Tile]:
    """Sample the rays that can meet cloud, and only those."""
    share, met = _shares(scene, batch)
    likely = share > 0
    for some, filled in tiles(np.flatnonzero(~likely), size):
        yield Tile(batch.index[some], _pick(_around(batch.ways), filled))
    # Rays that meet the same layers together: what no ray of a tile meets is skipped.
    order = np.argsort(_kinds(met), kind="stable")
    for some, filled in tiles(order[likely[order]], size):
        # Shadows may be of cloud that no ray meets.
        asked = np.any(met[:, some], axis=1)
        read = None if scene.shadows is not None else tuple(map(bool, asked))
        ways = _pick(batch.ways, filled)
        yield Tile(batch.index[some], sample(scene, ways, batch.textures, read))


def _sampled_tiles(scene: Scene, batch: _Batch, size: int) -> Iterator[Tile]:
    """Sample all rays, for scenes whose clouds may be anywhere."""
    # Those alike together, so that whole tiles are clear of a layer or of all.
    share, met = _shares(scene, batch)
    for some, filled in tiles(np.lexsort((_kinds(met), -share)), size):
        part = _pick(batch.ways, filled)
        if isinstance(part, Ways):
            part = sample(scene, part, batch.textures)
        yield Tile(batch.index[some], part)


def _around(ways: Ways | Surroundings) -> Surroundings:
    return ways.around if isinstance(ways, Ways) else ways


def _shares(
    scene: Scene, batch: _Batch
) -> tuple[Float[np.ndarray, " rays"], Bool[np.ndarray, "ways rays"]]:
    """How much of each ray's cloud counts, 0 where it is clear, and on which ways."""
    count = len(batch.index)
    if isinstance(batch.ways, Surroundings) or not batch.ways.of_sources:
        return np.zeros(count), np.zeros((0, count), bool)
    whole, met = (np.asarray(x)[..., :count] for x in _share(scene, batch.ways))
    return whole, met


def _kinds(met: Bool[np.ndarray, "ways rays"]) -> Int[np.ndarray, " rays"]:
    """A number for the ways that each ray meets."""
    # Beyond 62 ways some share a number, which only orders rays less well.
    none = np.zeros(met.shape[1], int)
    return sum((on << i % 62 for i, on in enumerate(met.astype(int))), none)


def _march(scene: Scene, jobs, part: range, with_products: bool, on_tile=None):
    """Paint a part of the rays, those that the jobs bring."""

    def march(job: Callable[[], Iterable[Tile]]) -> list:
        return [
            (tile.index, _seen(scene, tile.view, with_products=with_products))
            for tile in job()
        ]

    canvas, done = Canvas(len(part)), 0
    for parts in each(jobs, march):
        for index, seen in parts:
            canvas.paint(index - part.start, seen)
            done += len(index)
        if on_tile is not None:
            on_tile(done, len(part))
    return canvas.painted


def _whole_tile(tile: int | None) -> int:
    """How many rays are marched at once: as many for each device, also of the last."""
    devices = device_count()
    if tile is None:
        each_has = 8192 if jax.default_backend() == "cpu" else 1 << 17
        return each_has * devices
    # A last tile may have a sixteenth.
    return tile if devices == 1 else -(-tile // (16 * devices)) * 16 * devices


# Compiled by jax and not by equinox, whose calls cost a millisecond with so many parts:
# all leaves are arrays.
@ft.partial(jax.jit, static_argnames="with_products")
def _seen(scene: Scene, view: View | Surroundings, *, with_products: bool):
    """Radiances, and products in the same march, by all devices."""
    one = ft.partial(_block_by_block, with_products=with_products)
    return shared_out(one, scene, view)


def _block_by_block(scene: Scene, view: View | Surroundings, *, with_products: bool):
    """The same by one device, block by block: fewer rays meet fewer layers."""
    one = ft.partial(_seen_by_one, scene, with_products=with_products)
    rays = len(jax.tree.leaves(view)[0])
    if rays % _BLOCK or jax.default_backend() != "cpu":
        return one(view)
    blocks = jax.tree.map(lambda x: x.reshape(-1, _BLOCK, *x.shape[1:]), view)
    seen = jax.lax.map(one, blocks)
    return jax.tree.map(
        lambda x: jnp.moveaxis(x, 0, -2).reshape(*x.shape[1:-1], -1), seen
    )


def _seen_by_one(scene: Scene, view: View | Surroundings, *, with_products: bool):
    """The same of one block; where all is clear it is not marched."""

    def asked(both):
        return both if with_products else (both[0], None)

    if isinstance(view, Surroundings):
        return asked(see_clear(scene, view))
    if not view.samples:
        return asked(see_clear(scene, view.around))
    return jax.lax.cond(
        (cloud_share(scene, view.samples, view.layer_of) > 0).any(),
        lambda: asked(see(scene, view)),
        lambda: asked(see_clear(scene, view.around)),
    )


@jax.jit
def _share(scene: Scene, ways: Ways):
    layers = ways.of_sources, ways.layer_of
    each_way = jnp.stack(shares_of_ways(scene, *layers))
    return cloud_share(scene, *layers), each_way > 0


_pick = jax.jit(lambda whole, index: jax.tree.map(lambda x: x[index], whole))


def _counted(
    sight: Rays | Sensor | Sight, rays: int | None
) -> tuple[Rays | Sight, int]:
    if isinstance(sight, Rays | Sensor):
        every = lines_of_sight(sight)
        return every, len(every)
    if rays is None:
        raise ValueError(
            "Give the number of rays along with a function that makes them."
        )
    return sight, rays


def _jobs(
    scene: Scene,
    sight: Rays | Sight,
    part: range,
    sun_direction: Float[np.ndarray, "3"],
    tile: int,
) -> Iterator[_Job]:
    textures = make_textures(scene)

    def laid(numbers: Int[np.ndarray, " rays"]) -> Iterator[_Batch]:
        rays = some_rays(sight, numbers)
        rows = kinds(rays, scene.shell, scene.shells)
        for kind, members in grouped_alike(scene, rows):
            for index, filled in batches(members, tile, _TILES_AT_ONCE):
                some = rays[filled]
                if kind.knots:
                    ways = lay(
                        scene, some, sun_direction, kind.sampling, twice=kind.twice
                    )
                else:
                    ways = look_around(scene, some, sun_direction)
                yield _Batch(numbers[index], ways, textures)

    for start in part[:: tile * _TILES_IN_JOB]:
        numbers = np.arange(start, min(start + tile * _TILES_IN_JOB, part.stop))
        yield ft.partial(laid, numbers)
