"""cloudjax's own hard limit: one ray without a footprint, no width of the level set."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from cloudjax import (
    POINT,
    BandRadiances,
    FractalCloud,
    Rays,
    Scene,
    Weather,
    navigate,
    radiances,
    sample,
)


AT_ONCE = 4096

_sample, _radiances = eqx.filter_jit(sample), eqx.filter_jit(radiances)


class HardCloud(FractalCloud):
    """A step is cloud where the cloud function is positive."""

    def occupancy(self, samples, steps):
        soft = super().occupancy(samples, steps)
        return eqx.tree_at(lambda o: o.fraction, soft, jnp.round(soft.fraction))


def hardened(scene: Scene) -> Scene:
    """The scene with level sets of no width."""
    clouds = []
    for layer in scene.layers:
        fields = {name: getattr(layer.cloud, name) for name in FIELDS}
        hard = HardCloud(**fields)
        width = jnp.asarray(1e-3)
        clouds.append(eqx.tree_at(lambda c: c.function.smoothing, hard, width))
    return eqx.tree_at(lambda s: [layer.cloud for layer in s.layers], scene, clouds)


FIELDS = tuple(FractalCloud.__dataclass_fields__)


def hard_rays(
    scene: Scene, rays: Rays, sun, weather: Weather, behind, voxels: int
) -> np.ndarray:
    """Radiances of all bands, [bands rays].

    **Arguments:** `behind`: what rays of given numbers see without cloud.
    """
    scene = hardened(scene)
    textures = tuple(layer.cloud.make_textures(POINT, voxels) for layer in scene.layers)
    seen = []
    for start in range(0, len(rays), AT_ONCE):
        index = np.arange(start, min(start + AT_ONCE, len(rays)))
        view = navigate(scene, rays[index], sun, weather.masks)
        found = _radiances(scene, _sample(scene, view, textures), behind(index))
        seen.append(_stacked(found))
    return np.concatenate(seen, axis=1)


def _stacked(found: BandRadiances) -> np.ndarray:
    parts = (found.reflective, found.emissive)
    return np.concatenate([np.asarray(part) for part in parts if part is not None])
