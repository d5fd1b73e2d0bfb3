"""Rays without cloud see the ground, through the air of the scene."""

import jax
import jax.numpy as jnp

from cloudjax.light.ground import Leaving

from .scene import Scene
from .view import Surroundings


def background(scene: Scene, around: Surroundings) -> Leaving:
    """Find reflectance factor and radiance at the top of the atmosphere, without cloud.

    Zero where a ray misses the Earth.
    """
    ground = around.ground
    bare = scene.ground.seen(ground, scene.reflective, scene.emissive)
    if scene.ground.under_air:
        bare = _through_air(scene, around, bare)
    return jax.tree.map(lambda seen: jnp.where(ground.hit[None], seen, 0.0), bare)


def _through_air(scene: Scene, around: Surroundings, ground: Leaving) -> Leaving:
    air, column, altitude = scene.air, around.column, around.ground.altitude_m
    if air is None or column is None:
        return ground
    reflectance, radiance, glint = ground.reflectance, ground.radiance, ground.glint
    if scene.reflective is not None and reflectance is not None:
        veil = air.veil(scene.reflective, column, scene.temperature, altitude)
        reflectance = veil.path + veil.over(reflectance, column.sun)
        if glint is not None:
            glint = veil.passed * glint
    if scene.emissive is not None and radiance is not None:
        emission = air.emission(scene.emissive, column, scene.temperature)
        radiance = emission.over(radiance, altitude)
    return Leaving(reflectance, radiance, glint)
