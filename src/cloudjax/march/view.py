"""Views: all that depends on where rays run, found once on the host.

A view is a pytree of float32 arrays whose first axis are the rays. It depends on no
parameter of the clouds, so that one view serves every change of them: `radiances` and
`products` are pure functions of a scene and a view.
"""

import functools as ft
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Bool, Float, Int

from cloudjax.air.clear_air import Column
from cloudjax.geometry.footprint import Kind, Sampling, grouped, kinds
from cloudjax.geometry.geodesy import geodetic
from cloudjax.geometry.path import (
    Profile,
    device_array,
    find_chords,
    ground_points,
    points_along,
)
from cloudjax.geometry.rays import Rays, Sensor, lines_of_sight
from cloudjax.light.ground import GroundSamples

from .scene import Layer, Scene
from .shadows import Passage, Shades, find_shades


# Rays that are laid and sampled at once: their numbers fit the cache of a CPU core.
_AT_ONCE = 2048


class Surroundings(eqx.Module):
    """`Surroundings` are what rays pass beside cloud.

    **Fields:**

    - `ground`: where they meet it.
    - `column`: the air along each ray; None for scenes without.
    - `sun_direction`: unit vectors from the Earth to the sun, ECEF.
    """

    ground: GroundSamples
    column: Column | None
    sun_direction: Float[Array, "rays 3"]


class Ways(eqx.Module):
    """Rays laid through the layers of a scene, before clouds are sampled.

    **Fields:**

    - `of_sources`: one for each layer, and more for layers that rays meet twice.
    - `start_m`: where each way begins along the ray, relative to the first.
    - `air_k`: temperature along each way; None where that of the scene or of the air
      serves.
    - `around`: ground, air and sun.
    - `layer_of`: the layer of each way.
    """

    of_sources: tuple[Any, ...]
    start_m: tuple[Float[Array, " rays"], ...]
    air_k: tuple[Profile, ...] | None
    around: Surroundings
    layer_of: tuple[int, ...] = eqx.field(static=True)

    def __getitem__(self, index) -> "Ways":
        """Select some of the rays."""
        return jax.tree.map(lambda x: x[index], self)


class View(eqx.Module):
    """A `View` has all that depends on where rays run and on no parameter of the
    clouds.

    Make it with `look`. Every leaf has the rays as its first axis; `view[index]`
    selects some of them, and `jax.vmap` may run over them. It can be pickled.

    **Fields:**

    - `samples`: of each way, what its source of cloud sampled.
    - `start_m`, `air_k`, `around`, `layer_of`: as in `Ways`.
    - `shades`: clouds on the way to the sun; None without shadows.
    """

    samples: tuple[Any, ...]
    start_m: tuple[Float[Array, " rays"], ...]
    air_k: tuple[Profile, ...] | None
    around: Surroundings
    shades: Shades | None
    layer_of: tuple[int, ...] = eqx.field(static=True)

    def __len__(self) -> int:
        return len(self.around.sun_direction)

    def __getitem__(self, index) -> "View":
        """Select some of the rays."""
        return jax.tree.map(lambda x: x[index], self)

    @property
    def is_of_one_ray(self) -> bool:
        """Whether it has no axis of rays, as within `jax.vmap` over them."""
        return self.around.sun_direction.ndim == 1


def look(
    scene: Scene,
    sight: Rays | Sensor,
    sun_direction: Float[np.ndarray, "3"],
    draw: Int[np.ndarray, " rays"] | None = None,
) -> View:
    """Lay the rays of a sensor through a scene, on the host, once for many renders.

    Masks, winds, ground and air are read from the scene. Parameters of the clouds are
    not: the view stays right when they change.

    **Arguments:**

    - `sight`: the rays, or a sensor that has some (`Camera`, `FixedGrid`).
    - `sun_direction`: unit vector from the Earth to the sun, ECEF (`sun_over`).
    - `draw`: which draw of the clouds each ray sees, see `Scene.drawn_anew`; by default
      all see the scene's own, 0.

    **Raises:** `TypeError` for a scene of tracers: look before you differentiate.
    """
    require_concrete(scene, "look", "call it before jit, grad or vmap")
    rays = lines_of_sight(sight)
    groups, hold = _groups(scene, rays)
    draw = np.zeros(len(rays), int) if draw is None else draw
    parts, order = [], []
    for number in np.unique(draw):
        drawn = scene.drawn_anew(int(number))
        textures = make_textures(drawn)
        for sampling, twice, members in groups:
            mine = members[draw[members] == number]
            for index, filled in tiles(mine, _AT_ONCE):
                ways = lay(
                    drawn, rays[filled], sun_direction, hold(sampling), twice=twice
                )
                # What differs between draws is in their textures and ways.
                view = sample(scene, ways, textures)
                parts.append(jax.tree.map(ft.partial(_first, len(index)), view))
                order.append(index)
    place = np.argsort(np.concatenate(order))
    return jax.tree.map(lambda *some: jnp.asarray(np.concatenate(some)[place]), *parts)


def _first(count: int, rays: Array) -> np.ndarray:
    return np.asarray(rays)[:count]


def require_concrete(scene: Any, name: str, remedy: str) -> None:
    """Raise `TypeError` if a scene is being traced by jax."""
    if any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(scene)):
        raise TypeError(
            f"`{name}` works on the host and cannot be traced by jax: {remedy}; the "
            "pure functions are `radiances(scene, view)` and `products(scene, view)`."
        )


def _groups(scene: Scene, rays: Rays):
    """Rays that are read alike, and how what they need is held alike for all."""
    found = grouped_alike(scene, kinds(rays, scene.shell, scene.shells))
    misses = [members for kind, members in found if not kind.knots]
    hits = [both for both in found if both[0].knots]
    if misses:
        # They read nothing, and go with whatever others there are.
        kind, members = hits.pop() if hits else (Kind(1.0, 1.0), misses.pop())
        hits.append((kind, np.concatenate([members, *misses])))
    samplings = [kind.sampling for kind, _ in hits]
    twice = any(kind.twice for kind, _ in hits)
    most = max(sampling.knots for sampling in samplings)
    finest = min(sampling.finest_m for sampling in samplings)

    def hold(sampling: Sampling) -> Sampling:
        alike = finest if len(samplings) > 1 else None
        return replace(sampling, held_knots=most, held_finest_m=alike)

    groups = [(kind.sampling, twice, members) for kind, members in hits]
    return groups, hold


def grouped_alike(
    scene: Scene, rows: Int[np.ndarray, "rays 4"]
) -> list[tuple[Kind, Int[np.ndarray, " members"]]]:
    """Group rays, by rows of `kinds`, that all sources of a scene read alike.

    A group has the kind of its finest pixels.
    """
    groups: dict[Any, tuple[Kind, list]] = {}
    for kind, members in grouped(rows):
        key: Any = "misses"
        if kind.knots:
            points = tuple(x.cloud.points(kind.sampling) for x in scene.layers)
            knots = [kind.sampling.through(x.depth_m).knots for x in scene.shells]
            key = points, tuple(knots), kind.twice
        groups.setdefault(key, (kind, []))[1].append(members)
    return [(kind, np.concatenate(some)) for kind, some in groups.values()]


def lay(
    scene: Scene,
    rays: Rays,
    sun_direction: Float[np.ndarray, "3"],
    sampling: Sampling,
    *,
    twice: bool = False,
) -> Ways:
    """Lay rays of one kind through all layers, on the host in float64.

    **Arguments:** `twice`: follow rays that graze the Earth into a shell a second time.
    """
    ways, entries, layer_of, air = [], [], [], []
    asked = scene.shadows is not None or _sees_slopes(scene)
    sampling = replace(sampling, strains=asked)
    for i, layer in enumerate(scene.layers):
        own = sampling.through(layer.cloud.shell.depth_m)
        for chord in find_chords(rays, layer.cloud.shell)[: 1 + twice]:
            ways.append(layer.cloud.navigate(rays, chord, own))
            entries.append(chord.entry_m)
            layer_of.append(i)
            if scene.emissive is not None and scene.air is None:
                places = points_along(rays, chord, own.knots)
                found = [scene.temperature.at(*geodetic(place)) for place in places]
                known = [kelvin for kelvin in found if kelvin is not None]
                if known:
                    read = Profile(device_array(np.stack(known, axis=-1)), ends=True)
                    air.append(read.with_knots(sampling.held_knots))
    first = np.min(entries, axis=0) if entries else 0.0
    return Ways(
        tuple(ways),
        tuple(device_array(entry - first) for entry in entries),
        tuple(air) or None,
        look_around(scene, rays, sun_direction),
        tuple(layer_of),
    )


def look_around(
    scene: Scene, rays: Rays, sun_direction: Float[np.ndarray, "3"]
) -> Surroundings:
    """Read ground and air along rays, on the host."""
    places, hit = ground_points(rays)
    column = None
    if scene.air is not None:
        column = scene.air.look(rays, places, sun_direction)
    ground = scene.ground.look(
        rays, places, hit, sun_direction, scene.reflective, scene.emissive
    )
    sun = np.broadcast_to(sun_direction, (len(rays), 3))
    return Surroundings(ground, column, device_array(sun))


def _sees_slopes(scene: Scene) -> bool:
    return scene.reflective is not None and scene.reflection.sees_slopes


def make_textures(scene: Scene) -> tuple:
    """Make what the clouds of each layer are read from."""
    return tuple(layer.cloud.make_textures() for layer in scene.layers)


@jax.jit
def sample(
    scene: Scene,
    ways: Ways,
    textures: tuple,
    met: Sequence[Bool[Array, ""]] | None = None,
) -> View:
    """Sample each layer's clouds along its ways, and towards the sun for shadows.

    **Arguments:**

    - `textures`: of each layer.
    - `met`: whether cloud is likely on any ray of each way; nothing is read of others.
      The view then serves these parameters alone.
    """
    slopes = _sees_slopes(scene)
    layers = [scene.layers[i] for i in ways.layer_of]
    samples = tuple(
        _sampled(layer, way, textures[i], slopes, None if met is None else met[place])
        for place, (i, layer, way) in enumerate(
            zip(ways.layer_of, layers, ways.of_sources, strict=True)
        )
    )
    shades = None
    if scene.shadows is not None and scene.reflective is not None and samples:
        passages = [
            Passage(layer.cloud, textures[i], way, some, start)
            for i, layer, way, some, start in zip(
                ways.layer_of, layers, ways.of_sources, samples, ways.start_m,
                strict=True,
            )
        ]  # fmt: skip
        sun = ways.around.sun_direction
        shades = find_shades(scene.shadows, passages, ways.layer_of, sun)
    return View(samples, ways.start_m, ways.air_k, ways.around, shades, ways.layer_of)


def _sampled(layer: Layer, way, textures, slopes: bool, met) -> Any:
    """Sample a way, if any of it can meet cloud."""
    asked = {"steps": layer.steps, "slopes": slopes}
    found = ft.partial(layer.cloud.sample, **asked)
    if met is None:
        return found(way, textures)
    unread = layer.cloud.unread(way, textures, **asked)
    if unread is None:
        return found(way, textures)
    return jax.lax.cond(met, found, lambda *_: unread, way, textures)


def tiles(
    numbers: Int[np.ndarray, " rays"], tile: int
) -> Sequence[tuple[Int[np.ndarray, " some"], Int[np.ndarray, " filled"]]]:
    """Cut so many numbers at a time, each also filled up with copies of the last one.

    What is filled up is compiled for two sizes only, of which few rays get the small.
    """
    cut = []
    for start in range(0, len(numbers), tile):
        some = numbers[start : start + tile]
        size = tile if len(some) > tile // 16 else tile // 16
        cut.append((some, np.concatenate([some, np.full(size - len(some), some[-1])])))
    return cut
