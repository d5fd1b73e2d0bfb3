"""What a march along a direction of view meets in a box: cloud, light, ground."""

import functools as ft
from collections.abc import Callable
from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from cloudjax import BandRadiances, Scene, look
from cloudjax.geometry.rays import Rays
from cloudjax.geometry.shells import Shell, chords
from cloudjax.light.ground import AbstractGround, GroundSamples, Leaving
from cloudjax.march.marched_way import march_layers
from cloudjax.march.radiances import cloud_share, radiances, see_clear
from cloudjax.march.view import View, tiles

from .box import Picture


# Rays that are marched at once.
_TILE = 8192
# Optical depth of a step that no eye and no byte of opacity sees.
_LEAST_DEPTH = 1e-4
# Transmittance below which nothing is seen of what lies behind.
_DARK = 1e-6


@dataclass(frozen=True, eq=False)
class SeenCloud:
    """`SeenCloud` is the cloud of a box in pieces, one for each step of each ray.

    Depths of the pieces of a ray add up to minus the logarithm of the transmittance
    that the renderer has for its pixel.

    **Fields:**

    - `picture`: from where.
    - `ray`: of each piece, a pixel of the picture.
    - `place`: of each piece [m], in the box.
    - `depth`, `length_m`: optical depth and length of each piece, along the ray.
    - `cloudy`, `clear`: radiance of each pixel, as reflectance factors of the bands;
      with all cloud, and without.
    - `opacity`: 1 - T of each pixel by the renderer, also of cloud around the box.
    """

    picture: Picture
    ray: Int[np.ndarray, " pieces"]
    place: Float[np.ndarray, "pieces 3"]
    depth: Float[np.ndarray, " pieces"]
    length_m: Float[np.ndarray, " pieces"]
    cloudy: Float[np.ndarray, "bands rays"]
    clear: Float[np.ndarray, "bands rays"]
    opacity: Float[np.ndarray, " rays"]

    @property
    def column_depth(self) -> Float[np.ndarray, " rays"]:
        """Give the optical depth of the box along each ray."""
        # Of nothing at all numpy counts whole numbers.
        return np.bincount(self.ray, self.depth, len(self.opacity)).astype(float)


class _Matte(AbstractGround):
    """Ground without the sun's mirror image, which one viewer sees here, another there,
    and boards and their ground are for all.
    """

    ground: AbstractGround

    def look(
        self, rays, places, hit, sun_direction, reflective, emissive
    ) -> GroundSamples:
        return self.ground.look(rays, places, hit, sun_direction, reflective, emissive)

    def seen(self, samples, reflective, emissive) -> Leaving:
        return replace(self.ground.seen(samples, reflective, emissive), glint=None)


def near_by(scene: Scene) -> Scene:
    """Return a scene without the air above its clouds, as viewers near by see it."""
    ground = _Matte(scene.ground)
    return replace(scene, ground=ground, air=None, emissive=None, emission=None)


def see_cloud(
    scene: Scene,
    picture: Picture,
    sun_direction: Float[np.ndarray, "3"],
    *,
    extinction_share: float = 1.0,
    on_tile: Callable[[int, int], None] | None = None,
) -> SeenCloud:
    """March through a scene along all rays of a picture.

    **Arguments:**

    - `extinction_share`: of the physical extinction that the scene calls extinction;
      opacities are physical.
    - `on_tile`: called with the numbers of rays done and of all.
    """
    rays = picture.shape[0] * picture.shape[1]
    parts = []
    for index, filled in tiles(np.arange(rays), _TILE):
        parts.append(
            _march(scene, picture, sun_direction, extinction_share, index, filled)
        )
        if on_tile is not None:
            on_tile(int(index[-1]) + 1, rays)
    pieces = [np.concatenate(part) for part in zip(*(p[0] for p in parts), strict=True)]
    images = [
        np.concatenate(part, axis=-1)
        for part in zip(*(p[1] for p in parts), strict=True)
    ]
    return SeenCloud(picture, *pieces, *images)


def _march(scene: Scene, picture: Picture, sun, share: float, index, filled):
    rays, count = picture.rays(filled), len(index)
    view = look(scene, rays, sun)
    cloudy, clear, opacity, profiles = (
        jax.tree.map(lambda x: np.asarray(x, float), found)
        for found in _seen(scene, view, 1 / share)
    )
    pieces = [
        _pieces(
            picture,
            rays[:count],
            scene.layers[i].cloud.shell,
            *(one[:count] for one in profile),
        )
        for i, profile in zip(view.layer_of, profiles, strict=True)
    ]
    ray, *known = (np.concatenate(part) for part in zip(*pieces, strict=True))
    images = cloudy[:, :count], clear[:, :count], opacity[:count]
    return (index[ray], *known), images


def _seen(scene: Scene, view: View, power: Float[Array, ""] | float):
    """Reflectance factors with and without cloud, opacity, and of each way the
    transmittance to the end of each step and where it is.
    """
    bands, cloudy, clear = scene.reflective, radiances(scene, view), _clear(scene, view)
    assert bands is not None
    assert cloudy.reflective is not None
    assert clear.reflective is not None
    through = _through(scene, view, power)
    opacity = 1 - ft.reduce(jnp.multiply, [t[:, -1] for t, _ in through])
    found = bands.reflectance(cloudy.reflective), bands.reflectance(clear.reflective)
    return *found, opacity, through


# Compiled apart from the radiances: together XLA takes minutes longer.
@jax.jit
def _through(scene: Scene, view: View, power: Float[Array, ""] | float):
    """Transmittance from the entry of each way to the end of each step, and distances
    [m] of the ends from the entry.
    """
    share = cloud_share(scene, view.samples, view.layer_of)[:, None]
    return [
        (
            (1 - share * (1 - way.passed.transmittance(way.layer.extinction_per_m)))
            ** power,
            way.start_m[:, None] + way.path.step_ends_m(way.layer.steps),
        )
        for way in march_layers(scene, view)
    ]


@jax.jit
def _clear(scene: Scene, view: View) -> BandRadiances:
    return see_clear(scene, view.around)[0]


def _pieces(
    picture: Picture,
    rays: Rays,
    shell: Shell,
    through: Float[np.ndarray, "rays ends"],
    ends_m: Float[np.ndarray, "rays ends"],
):
    """Steps with cloud: their rays, places, depths and lengths."""
    seen = np.maximum(through, _DARK)
    depth = np.log(seen[:, :-1] / seen[:, 1:])
    ray, step = np.nonzero(depth > _LEAST_DEPTH)
    chord = chords(rays, shell)
    first, last = ends_m[ray, step], ends_m[ray, step + 1]
    distance = chord.entry_m[ray] + (first + last) / 2
    place = picture.box.local_m(rays[ray].at(distance))
    inside = picture.box.holds(place)
    length = last - first
    return ray[inside], place[inside], depth[ray, step][inside], length[inside]
