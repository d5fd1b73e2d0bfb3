"""What looks at the scenes of `extreme_scenes`: any rays, under any mask.

Views of one kind are alike, whatever their rays: what is compiled for one serves all.
"""

import functools as ft
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np

from cloudjax import (
    AbstractMask,
    CoarseFields,
    LatLonGrid,
    MaskGrid,
    PlaneParallel,
    Rays,
    Scene,
    View,
)
from cloudjax.geometry.geodesy import ecef
from cloudjax.march.view import lay, make_textures, sample
from tests.extreme_scenes import Kind
from tests.helpers import GEOSTATIONARY_M, FunctionMask, rays_to, sampling


def scene_under(
    scene: Scene,
    mask: AbstractMask,
    fields: np.ndarray | None = None,
    displacements=None,
) -> Scene:
    """Put all layers of a scene under one mask.

    **Arguments:** `fields`: optical depth, top and roughness, the same everywhere.
    """
    nodes = np.zeros((2, 3, 3)) + (0 if fields is None else fields)
    grid = LatLonGrid.from_axes(np.array([-90.0, 90.0]), np.array([0.0, 120.0, 240.0]))
    layers = tuple(
        replace(
            layer,
            cloud=replace(
                layer.cloud,
                mask=mask,
                fields=CoarseFields(jnp.asarray(nodes, float), grid),
                displacements=displacements,
            ),
        )
        for layer in scene.layers
    )
    return replace(scene, layers=layers)


def view_of(
    kind: Kind,
    rays: Rays,
    sun: np.ndarray,
    mask=lambda φ, λ: 0 * φ,
    fields: np.ndarray | None = None,
    displacements=None,
) -> View:
    """Lay rays through a scene of a kind; all views of one kind are alike.

    **Arguments:** `fields`, `displacements`: as of `scene_under`.
    """
    scene = kind.scene(kind.vector(), PlaneParallel.load())
    weathered = scene_under(scene, FunctionMask(mask), fields, displacements)
    # As often as the rungs of the narrowest pixel, and the masks of the longest way.
    ways = lay(weathered, rays, sun, sampling(0.0, 9))
    return sample(scene, ways, make_textures(scene))


def joined(views: list[View]) -> View:
    """All rays of some views of one kind."""
    return jax.tree.map(lambda *some: jnp.concatenate(some), *views)


# Drawn --------------------------------------------------------------------------------

RAYS_PER_SUN = 8


def drawn(
    kind: Kind, rng: np.random.Generator, count: int, above: bool = False
) -> tuple[np.ndarray, View]:
    """Draw vectors and a ray for each; a number of a vector is often at an end."""
    views = []
    for _ in range(count // RAYS_PER_SUN):
        a, b, c = rng.uniform(-4, 4, 3)
        fields = _fields(rng)
        rays = drawn_rays(rng, RAYS_PER_SUN, above)
        sun = _unit(rng.normal(size=3))
        mask = ft.partial(_waves, a=a, b=b, c=c)
        views.append(view_of(kind, rays, sun, mask, fields))
    return _vectors(kind, rng, count), joined(views)


def drawn_scene(
    kind: Kind, rng: np.random.Generator, count: int
) -> tuple[Scene, Rays, np.ndarray]:
    """Draw one scene, rays from geostationary orbit and a sun.

    The rays are read alike but for those that miss the Earth, one in eight: renders are
    compiled for each kind of ray. Of the scene all that is drawn is in arrays.
    """
    cover = np.clip(rng.uniform(-1, 2, (19, 36)), 0, 1)
    axes = np.linspace(-90.0, 90.0, 19), np.arange(0.0, 360.0, 10.0)
    scene = kind.scene(_vectors(kind, rng, 1)[0], PlaneParallel.load())
    weathered = scene_under(scene, MaskGrid.from_fraction(cover, *axes), _fields(rng))
    φ, λ = rng.uniform(-35, 35, (2, count))
    target = ecef(φ, λ, np.zeros(count))
    target[::8] = 0.0, 9e6, 0.0
    return weathered, rays_to(GEOSTATIONARY_M, target), _unit(rng.normal(size=3))


def drawn_rays(rng: np.random.Generator, count: int, above: bool = False) -> Rays:
    """From orbits, from aircraft within the clouds and from the ground; anywhere to.

    **Arguments:** `above`: from orbits to the ground only.
    """
    heights = [3.6e7, 8e5, 4e5] if above else [3.6e7, 8e5, 2e4, 9e3, 3e3, 500.0, 2.0]
    places = (-90.0, 90.0, 0.0, rng.uniform(-90, 90))
    origin = ecef(
        rng.choice(places, count),
        rng.choice([-180.0, 180.0, 0.0, rng.uniform(-180, 180)], count),
        rng.choice(heights, count),
    )
    radius = np.linalg.norm(origin, axis=-1)
    down, any_way = -origin / radius[:, None], _unit(rng.normal(size=(count, 3)))
    level = _unit(any_way - (any_way * down).sum(-1, keepdims=True) * down)
    # Straight down, aslant, to the limb and a little beyond it.
    limb = 6.3e6 if above else 6.37e6 + rng.uniform(-5e4, 5e4, count)
    sine = np.minimum(limb / radius, 1) * rng.choice([0.0, 0.3, 0.9, 1.0], count)
    aimed = level * sine[:, None] + down * np.sqrt(1 - sine**2)[:, None]
    astray = (rng.random(count) < (0 if above else 0.15))[:, None]
    pixel_rad = np.exp(rng.uniform(np.log(1e-8), np.log(3e-3), count))
    return Rays(origin, _unit(np.where(astray, any_way, aimed)), pixel_rad)


def _vectors(kind: Kind, rng: np.random.Generator, count: int) -> np.ndarray:
    return np.clip(rng.uniform(-0.2, 1.2, (count, len(kind.ranges))), 0, 1)


def _fields(rng: np.random.Generator) -> np.ndarray:
    return rng.uniform(-1, 1, 3) * np.array([3.0, 2000.0, 1.5])


def _waves(φ, λ, a, b, c):
    return 4 * np.sin(a * φ + b * λ + c)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
