"""The march through a shell finds optical depth, transmittance, first surface.

The cloud of a step is spread evenly over it, so that transmittance is an exact
exponential within each segment.
"""

import equinox as eqx
import jax.numpy as jnp
from jax.scipy.special import ndtr
from jaxtyping import Array, Float

from cloudjax.clouds.source import Occupancy, Slopes
from cloudjax.geometry.path import to_points


class March(eqx.Module):
    """A `March` is the cloud met along rays, front to back.

    **Fields:**

    - `ends_m`: length of the way through cloud, up to the ends of the steps, the first
      of which is the entry.
    - `segment_m`: the same within each step.
    - `weights`: of the sub-pixel structures (the nodes).
    - `slopes`: of the cloud's surface; None where no normals are asked.
    """

    ends_m: Float[Array, "nodes rays ends"]
    segment_m: Float[Array, "nodes rays steps"]
    weights: Float[Array, " nodes"]
    slopes: Slopes | None

    @property
    def depth_m(self) -> Float[Array, "nodes rays"]:
        """Give the length of the way through cloud, L of eq. (3)."""
        return self.ends_m[..., -1]

    @property
    def cloud_m(self) -> Float[Array, "nodes rays steps"]:
        """Give the length of the way through cloud, up to the end of each step."""
        return self.ends_m[..., 1:]

    def absorbed(
        self, extinction_per_m: Float[Array, ""]
    ) -> Float[Array, "nodes rays steps"]:
        """Return the share of light looking back that each step stops: Σ = 1 - T."""
        # Not as a difference of the two lengths: it would leave derivatives of deep
        # cloud with the rounding of both, many times their own size.
        before = jnp.exp(-extinction_per_m * self.ends_m[..., :-1])
        return before * -jnp.expm1(-extinction_per_m * self.segment_m)

    def transmittance(
        self,
        extinction_per_m: Float[Array, ""],
        stopped: Float[Array, "nodes rays"] | None = None,
    ) -> Float[Array, "rays ends"]:
        """Return the mean over sub-pixel structures, from the entry to ends of steps.

        **Arguments:** `stopped`: a factor on what is taken from the light.
        """
        through = jnp.exp(-extinction_per_m * self.ends_m)
        if stopped is not None:
            through = 1 - stopped[..., None] * (1 - through)
        return self.mean(through)

    def mean(self, per_node: Float[Array, "nodes *rest"]) -> Float[Array, "*rest"]:
        """Return the average over the sub-pixel structures."""
        return jnp.tensordot(self.weights, per_node, axes=1)


def march(occupancy: Occupancy, length_m: Float[Array, " rays"]) -> March:
    """Add up the cloud along chords of a length in equal steps."""
    steps = occupancy.fraction.shape[-1]
    segment = occupancy.fraction * (length_m / steps)[None, :, None]
    # A product with ones is three times as fast as a running sum along the last axis.
    # It makes the 0 at the entry, too. Were that 0 concatenated, XLA would ask of every
    # element in all later code whether it is the 0, which is five times as slow.
    before = jnp.triu(jnp.ones((steps, steps + 1), segment.dtype), 1)
    ends = jnp.matmul(segment, before, precision="highest")
    return March(ends, segment, occupancy.weights, occupancy.slopes)


class FirstSurface(eqx.Module):
    """A `FirstSurface` is where a ray is expected to meet the cloud, by the weights of
    what it absorbs.

    A pixel sees a rough surface: slopes that it does not resolve have a normal
    distribution about their mean.

    **Fields:**

    - `distance_m`: from the entry into the shell; meaningless without cloud.
    - `slope`: mean of -∇CF over what is seen, points out of the cloud.
    - `slope_variance`: of each component.
    """

    distance_m: Float[Array, "nodes rays"]
    slope: Float[Array, "3 nodes rays"]
    slope_variance: Float[Array, " rays"]

    @property
    def normal(self) -> Float[Array, "3 nodes rays"]:
        """Give the unit vector along the mean slope."""
        return self.slope / jnp.sqrt((self.slope**2).sum(0) + 1e-24)[None]

    def illumination(
        self, sun_direction: Float[Array, "rays 3"]
    ) -> tuple[Float[Array, "nodes rays"], Float[Array, "nodes rays"]]:
        """Return means of max(n·s, 0) and of max(-n·s, 0) over the rough surface.

        n = slope/|slope|, with the root mean square of |slope| for the denominator;
        n·s is normal with mean m and deviation σ: E max(x, 0) = m Φ(m/σ) + σ φ(m/σ).
        """
        size = jnp.sqrt((self.slope**2).sum(0) + 3 * self.slope_variance[None] + 1e-24)
        mean = jnp.sum(self.slope * sun_direction.T[:, None], axis=0) / size
        spread = jnp.sqrt(self.slope_variance[None] / size**2 + 1e-8)
        lit = mean * ndtr(mean / spread) + spread * _normal(mean / spread)
        return lit, lit - mean


def first_surface(
    absorbed: Float[Array, "nodes rays steps"],
    distance_m: Float[Array, "rays steps"],
    slopes: Slopes,
    direction: Float[Array, "rays 3"],
) -> FirstSurface:
    """Find the expected depth and slope of the first surface (section 2.1).

    **Arguments:** `direction`: of the rays.
    """
    total = jnp.maximum(absorbed.sum(-1), 1e-12)
    distance = (absorbed * distance_m[None]).sum(-1) / total
    weights = absorbed / total[..., None]
    points = slopes.gradient.shape[-1]
    share = jnp.asarray(to_points(weights.shape[-1], points), weights.dtype)
    at = jnp.matmul(weights, share, precision="highest")
    rise = jnp.matmul(weights * slopes.rise[None], share, precision="highest")
    # A trace of the vertical decides where the cloud function is flat, and keeps the
    # normalisation finite. 1e-9 per metre is far below any slope of CF.
    rise = rise - 1e-9 * at
    slope = -jnp.stack(
        [
            (at * gradient[None] + rise * up[None]).sum(-1)
            for gradient, up in zip(slopes.gradient, slopes.up, strict=True)
        ]
    )
    back = direction.T[:, None, :]
    variance = slopes.unresolved
    gained = _turned_to_viewer(-(slope * back).sum(0), variance[None])
    return FirstSurface(distance, slope - gained[None] * back, variance)


def _turned_to_viewer(rise, variance):
    """By how much the rise of CF along a ray is greater where the ray enters cloud.

    Of a rough surface a ray meets the parts that face it, with a probability in
    proportion to the rise x (Rice 1944): the mean of x there is E[x²; x > 0]/E[x; x >
    0], for a normal x = σ ((t² + 1) Φ + t φ)/(t Φ + φ) with t the mean over σ.
    """
    σ = jnp.sqrt(variance + 1e-18)
    # Beyond these both parts are small differences of large numbers, and gain nothing.
    t = jnp.clip(rise / σ, -4.0, 10.0)
    Φ, φ = ndtr(t), _normal(t)
    mean = ((t**2 + 1) * Φ + t * φ) / (t * Φ + φ)
    return σ * (mean - t)


def _normal(x):
    return jnp.exp(-(jnp.clip(x, -12.0, 12.0) ** 2) / 2) / jnp.sqrt(2 * jnp.pi)
