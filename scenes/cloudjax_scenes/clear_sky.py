"""Ground without cloud, through the air of a scene."""

import equinox as eqx
from jaxtyping import Array, Float

from cloudjax import BandRadiances, Scene
from cloudjax.air.clear_air import Column


@eqx.filter_jit
def through_air(
    scene: Scene,
    column: Column,
    ground: BandRadiances,
    altitude_m: Float[Array, " rays"],
) -> BandRadiances:
    """Reflectance factor and radiance of ground, seen from space."""
    assert scene.air is not None
    reflective = emissive = None
    if scene.reflective is not None and ground.reflective is not None:
        veil = scene.air.veil(scene.reflective, column, altitude_m)
        reflective = veil.path + veil.over(ground.reflective, column.sun)
    if scene.emissive is not None and ground.emissive is not None:
        emission = scene.air.emission(scene.emissive, column, scene.temperature)
        emissive = emission.over(ground.emissive, altitude_m)
    return BandRadiances(reflective, emissive)
