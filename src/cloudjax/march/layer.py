"""Layers are made from classes of cloud."""

from collections.abc import Sequence
from dataclasses import replace

import jax.numpy as jnp

from cloudjax.clouds.classes import CloudClass
from cloudjax.clouds.level_set import Latent
from cloudjax.light.cloud_optics import ParticleOptics
from cloudjax.light.optics import Particles
from cloudjax.weather.advection import DisplacementMap
from cloudjax.weather.coarse_fields import CoarseFields
from cloudjax.weather.masks import AbstractMask

from .scene import Layer


def class_layer(
    cloud_class: CloudClass,
    *,
    sunlit: Sequence[int] = (),
    thermal: Sequence[int] = (),
    seed: int = 0,
    steps: int = 24,
    nodes: int = 5,
    extinction_share: float = 1.0,
    movable: bool = False,
    mask: AbstractMask | None = None,
    displacements: Sequence[DisplacementMap | None] | None = None,
    fields: CoarseFields | None = None,
) -> Layer:
    """Make the layer of a class for the bands of a scene.

    **Arguments:**

    - `sunlit`, `thermal`: numbers of the bands that see the sun, and of those that
      emit, as the scene lists them.
    - `seed`: of the textures; `steps`: of the march through the shell; `nodes`:
      sub-pixel structures that radiances are averaged over.
    - `extinction_share`: of the physical extinction that the scene's light calls
      extinction; absorption in the infrared stays the physical one.
    - `movable`: a fit will move the cloud within its shell, see `CloudClass.cloud`.
    - `mask`, `displacements`: where the weather lets it stand, and how the wind has
      drawn each of its textures.
    - `fields`: what its clouds are like from place to place.
    """
    cloud = replace(
        cloud_class.cloud(seed, movable=movable),
        latent=Latent.equal_shares(nodes),
        mask=mask,
        displacements=None if displacements is None else tuple(displacements),
        fields=fields,
    )
    ratio, radius_um = cloud_class.own_infrared_ratio, cloud_class.effective_radius_um
    return Layer(
        cloud=cloud,
        extinction_per_m=jnp.asarray(
            extinction_share * cloud_class.extinction_per_m, float
        ),
        optics=ParticleOptics(
            Particles(cloud_class.particles, jnp.asarray(radius_um, float)),
            None if ratio is None else jnp.asarray(ratio / extinction_share, float),
            sunlit=tuple(sunlit),
            thermal=tuple(thermal),
            share=extinction_share,
        ),
        name=cloud_class.name,
        steps=steps,
    )
