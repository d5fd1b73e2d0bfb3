"""All pixels of imagery, simulated."""

from dataclasses import dataclass

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float

from cloudjax import Scene, render
from cloudjax_data import sun_direction

from .imagery_scene import SceneFromImagery
from .lights import light_of


@dataclass(frozen=True, eq=False)
class SimulatedImage:
    """A `SimulatedImage` has all pixels of imagery, simulated.

    **Fields:**

    - `bands`: their numbers, in the order of `radiance`.
    - `radiance`: NaN off the Earth.
    - `cloud`: the softly selected share of each pixel, 0 off the Earth.
    - `depths`: vertical optical depths of each class of cloud, physical, at 0.64 µm;
      0 off the Earth.
    """

    bands: tuple[int, ...]
    radiance: Float[np.ndarray, "bands y x"]
    cloud: Float[np.ndarray, "y x"]
    depths: Float[np.ndarray, "classes y x"]

    @property
    def optical_depth(self) -> Float[np.ndarray, "y x"]:
        """Give the optical depth of all clouds."""
        return self.depths.sum(0)

    @property
    def on_earth(self) -> Bool[np.ndarray, "y x"]:
        """Tell which pixels see the Earth."""
        return np.isfinite(self.radiance[0])

    def band(self, number: int) -> Float[np.ndarray, "y x"]:
        """Return the radiances of a band."""
        return self.radiance[self.bands.index(number)]


def simulate_image(scene: Scene, made_of: SceneFromImagery) -> SimulatedImage:
    """Render all pixels of imagery that see the Earth.

    **Arguments:**

    - `scene`: built of `made_of`, perhaps with other parameters.
    """
    imagery = made_of.imagery
    rays, hit = imagery.on_earth()
    image = render(
        scene,
        rays,
        sun_direction(imagery.time),
        with_products=True,
    )
    clouds = image.clouds
    assert clouds is not None
    seen = scene.total(image.radiances)
    weights = eqx.filter_jit(imagery.rule.weights)(seen, scene)
    values = np.asarray(seen)
    radiance = np.full((len(values), hit.size), np.nan, values.dtype)
    radiance[:, hit] = values
    cloud = np.zeros(hit.size, values.dtype)
    cloud[hit] = np.asarray(weights)
    depths = np.zeros((len(scene.layers), hit.size), values.dtype)
    depths[:, hit] = np.asarray(clouds.depths) / light_of(scene).share
    shape = imagery.grid.shape
    return SimulatedImage(
        scene.bands,
        radiance.reshape(-1, *shape),
        cloud.reshape(shape),
        depths.reshape(-1, *shape),
    )
