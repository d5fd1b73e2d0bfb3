"""cloudjax's own hard limit: one ray without a footprint, no width of the level set."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from cloudjax import (
    BandRadiances,
    Rays,
    Sampling,
    Scene,
    radiances,
)
from cloudjax.geometry.footprint import Footprint
from cloudjax.march.view import lay, make_textures, sample

from .straight import FIELDS, StraightCloud


AT_ONCE = 4096


class HardCloud(StraightCloud):
    """A step is cloud where the cloud function is positive."""

    def pixel(self, way, steps):
        return Footprint.level(0 * way.width_m, way.stretch)

    def level(self, value, common, own):
        shifted, share = super().level(value, common, own)
        return shifted, jnp.round(share)


def hardened(scene: Scene) -> Scene:
    """The scene with level sets of no width."""
    clouds = []
    for layer in scene.layers:
        fields = {name: getattr(layer.cloud, name) for name in FIELDS}
        hard = HardCloud(**fields)
        width = jnp.asarray(1e-3)
        clouds.append(eqx.tree_at(lambda c: c.function.smoothing, hard, width))
    return eqx.tree_at(lambda s: [layer.cloud for layer in s.layers], scene, clouds)


def hard_rays(scene: Scene, rays: Rays, sun) -> np.ndarray:
    """Radiances of all bands, [bands rays]."""
    scene = hardened(scene)
    textures = make_textures(scene)
    seen = []
    for start in range(0, len(rays), AT_ONCE):
        ways = lay(
            scene, rays[start : start + AT_ONCE], sun, Sampling(0.0, stretch=6.0)
        )
        view = sample(scene, ways, textures)
        seen.append(_stacked(radiances(scene, view)))
    return np.concatenate(seen, axis=1)


def _stacked(found: BandRadiances) -> np.ndarray:
    parts = (found.reflective, found.emissive)
    return np.concatenate([np.asarray(part) for part in parts if part is not None])
