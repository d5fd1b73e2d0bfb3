"""Textures that are renewed: each is the sum of noises that fade and grow."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import jax.numpy as jnp

from cloudjax.weather.advection import DisplacementMap

from .fractal import FractalCloud


class Generation(NamedTuple):
    """A `Generation` is noise of one age.

    **Fields:** `amplitude`: the squares of those of all generations of a texture add up
    to 1; `displacement`: how the wind has drawn it, None for still air.
    """

    amplitude: float
    displacement: DisplacementMap | None


def in_generations(
    cloud: FractalCloud, textures: Sequence[tuple[Generation, ...]]
) -> FractalCloud:
    """Return the cloud with its textures in generations.

    Generations of one texture are independent noise, so that the sum has the spectrum
    and the variance of the texture, and the cloud covers as much as before.

    **Arguments:** `textures`: the generations of each, as many of all.
    """
    f, generations = cloud.function, list(zip(*textures, strict=True))
    count = len(generations)
    amplitudes = [[one.amplitude for one in each] for each in generations]
    weights = [jnp.asarray(each, float) * f.weights for each in amplitudes]
    function = replace(
        f,
        weights=jnp.concatenate(weights),
        persistences=jnp.tile(f.persistences, count),
        gains=jnp.tile(f.gains, count),
    )
    maps = tuple(one.displacement for each in generations for one in each)
    ladders = cloud.ladders * count
    return replace(cloud, function=function, ladders=ladders, displacements=maps)
