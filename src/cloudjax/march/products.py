"""Products are what is known of the clouds of each ray beside their radiances."""

from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from cloudjax.clouds.visibility import unseen

from .marched_way import MarchedWay, Seen, top_altitude_m
from .scene import Scene


class CloudProducts(eqx.Module):
    """`CloudProducts` are what is known of the clouds of each ray beside radiances.

    **Fields:**

    - `fraction`: of the pixel that cloud covers: where its optical depth exceeds 0.3,
      softly.
    - `depths`: optical depths of each layer at the reference band, as if looked at from
      straight above.
    - `top_height_m`: mean altitude of the first surface; NaN where nothing is met.
    - `share`: of the light looking back that each layer stops.
    """

    fraction: Float[Array, " rays"]
    depths: Float[Array, "layers rays"]
    top_height_m: Float[Array, " rays"]
    share: Float[Array, "layers rays"]

    @property
    def optical_depth(self) -> Float[Array | np.ndarray, " rays"]:
        """Give the optical depth of all layers."""
        return self.depths.sum(0)


def no_cloud(layers: int, rays: int) -> CloudProducts:
    """Give the products of rays that meet no cloud."""
    none, no_height = jnp.zeros((layers, rays)), jnp.full(rays, jnp.nan)
    return CloudProducts(jnp.zeros(rays), none, no_height, none)


def products_of(
    scene: Scene,
    ways: Sequence[MarchedWay],
    first: Seen,
    layer_of: Sequence[int],
    cloudy: Float[Array, " rays"],
) -> CloudProducts:
    """Sum up what the ways have met.

    **Arguments:** `first`: of the reference band. `cloudy`: of each ray, the share that
    is not clear by decision (`radiances.cloud_share`).
    """
    rays = ways[0].path.length_m.shape
    clear = jnp.ones(rays)
    depths = [jnp.zeros(rays) for _ in scene.layers]
    share = [jnp.zeros(rays) for _ in scene.layers]
    for i, way, stopped in zip(layer_of, ways, first.steps, strict=True):
        β = way.layer.extinction_per_m
        vertical = β * way.passed.depth_m * way.view_height[None]
        clear = clear * way.passed.mean(unseen(vertical))
        depths[i] = depths[i] + way.passed.mean(vertical)
        share[i] = share[i] + stopped.sum(-1)
    met = (sum(share, jnp.zeros(rays)) > 1e-3) & (cloudy > 0)
    top = jnp.where(met, top_altitude_m(ways, first), jnp.nan)
    # Weights of a quadrature add up to one but for rounding.
    cover = jnp.clip(1 - clear, 0, 1)
    each = cloudy[None]
    return CloudProducts(
        cloudy * cover, each * jnp.stack(depths), top, each * jnp.stack(share)
    )
