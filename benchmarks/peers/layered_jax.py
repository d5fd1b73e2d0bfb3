"""The paper's algorithm for several classes of cloud and several bands, in JAX.

As the paper does: one march for each class, then the layers laid over one another.
Reflective bands by eqs (3) and (4), the infrared at the temperature of the first
surface and with eq. (5).
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from . import brute_jax
from .work import LAPSE_K_PER_M, SEA_LEVEL_K, TROPOPAUSE_K, Picture


def prepare(picture: Picture):
    first = picture.layers[0]
    direction = tuple(jnp.asarray(x) for x in first.direction.T)
    layers = [
        (
            [jnp.asarray(v) for v in work.clouds.voxels],
            jnp.asarray(work.clouds.mask.values),
            brute_jax.numbers(work),
        )
        for work in picture.layers
    ]
    light = tuple(
        jnp.asarray(x, jnp.float32)
        for x in (
            picture.depths_per_m,
            picture.shares,
            picture.planck,
            picture.air,
            picture.behind,
        )
    )
    axes = brute_jax.Axes(first.clouds.mask)
    run = partial(_render, steps=first.steps, axes=axes)
    return lambda: np.asarray(run(direction, layers, *light))


@partial(jax.jit, static_argnames=("steps", "axes"))
def _render(
    direction, layers, depths_per_m, shares, planck, air, behind, *, steps, axes
):
    reflective, emissive = behind[:-1], behind[-1]
    for i, (textures, mask, p) in enumerate(layers):
        depth, cosine, altitude, height = brute_jax.march(
            direction, textures, mask, p, steps, axes
        )
        τ = depths_per_m[i][:, None] * depth
        own = brute_jax.shade(τ[:-1], cosine, height, p["indirect"])
        passed = jnp.exp(-τ)
        a = air[:, None]
        reflective = a + shares[i][:, None] * own + passed[:-1] * (reflective - a)
        emitted = (1 - passed[-1]) * _planck(altitude, planck)
        emissive = emitted + passed[-1] * emissive
    return jnp.concatenate([reflective, emissive[None]])


def _planck(altitude, p):
    kelvin = jnp.maximum(SEA_LEVEL_K - LAPSE_K_PER_M * altitude, TROPOPAUSE_K)
    return p[0] / jnp.expm1(p[1] / (p[2] + p[3] * kelvin))
