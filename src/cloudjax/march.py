"""The march through a shell: optical depth, transmittance, first surface.

The cloud of a step is spread evenly over it, so that transmittance is an exact
exponential within each segment.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from .source import Occupancy


class March(eqx.Module):
    """Cloud met along rays, front to back.

    **Fields:**

    - `cloud_m`: length of the way through cloud, up to the end of each step.
    - `segment_m`: the same within each step.
    - `weights`: of the sub-pixel structures (the nodes).
    - `gradient`: points into the cloud; None where no normals are asked.
    """

    cloud_m: Float[Array, "nodes rays steps"]
    segment_m: Float[Array, "nodes rays steps"]
    weights: Float[Array, " nodes"]
    gradient: Float[Array, "3 rays steps"] | None

    @property
    def depth_m(self) -> Float[Array, "nodes rays"]:
        """Length of the way through cloud, L of eq. (3)."""
        return self.cloud_m[..., -1]

    def absorbed(
        self, extinction_per_m: Float[Array, ""]
    ) -> Float[Array, "nodes rays steps"]:
        """The share of the light looking back that each step stops: Σ = 1 - T."""
        before = jnp.exp(-extinction_per_m * (self.cloud_m - self.segment_m))
        return before * -jnp.expm1(-extinction_per_m * self.segment_m)

    def mean(self, per_node: Float[Array, "nodes *rest"]) -> Float[Array, "*rest"]:
        """The average over the sub-pixel structures."""
        return jnp.tensordot(self.weights, per_node, axes=1)


def march(occupancy: Occupancy, length_m: Float[Array, " rays"]) -> March:
    """Add up the cloud along chords of a length in equal steps."""
    steps = occupancy.fraction.shape[-1]
    segment = occupancy.fraction * (length_m / steps)[None, :, None]
    return March(
        jnp.cumsum(segment, axis=-1), segment, occupancy.weights, occupancy.gradient
    )


class FirstSurface(eqx.Module):
    """Where a ray is expected to meet the cloud, by the weights of what it absorbs.

    **Fields:**

    - `distance_m`: from the entry into the shell; meaningless without cloud.
    - `normal`: unit vector out of the cloud.
    """

    distance_m: Float[Array, "nodes rays"]
    normal: Float[Array, "3 nodes rays"]


def first_surface(
    absorbed: Float[Array, "nodes rays steps"],
    distance_m: Float[Array, "rays steps"],
    gradient: Float[Array, "3 rays steps"],
    up: Float[Array, "3 rays steps"],
) -> FirstSurface:
    """The expected depth and normal of the first surface (section 2.1)."""
    total = jnp.maximum(absorbed.sum(-1), 1e-12)
    distance = (absorbed * distance_m[None]).sum(-1) / total
    # A trace of the vertical decides where the cloud function is flat, and keeps the
    # normalisation finite. 1e-9 per metre is far below any slope of CF.
    outward = 1e-9 * up - gradient
    weights = absorbed / total[..., None]
    mean = jnp.stack([(weights * component[None]).sum(-1) for component in outward])
    length = jnp.sqrt((mean**2).sum(0) + 1e-24)
    return FirstSurface(distance, mean / length[None])
