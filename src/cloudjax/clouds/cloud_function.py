"""The cloud function is eq. (1) of Schinder et al. 2024, with standardised textures.

Their offsets b_i fold into the threshold T:

    CF(x) = Σ_o a_o N_o(x') + g w(x) - a exp(-(z - z_b)/h) - a exp((z - z_t)/h) - T

Multiplying m, g, a and T by one number moves no cloud. That gauge is fixed by holding
the first weight at 1; and since a and h move the barriers as z_b and z_t do, a is held
as well.
"""

import equinox as eqx
import jax.numpy as jnp
from jax.scipy.special import ndtr
from jaxtyping import Array, Float

from .ladder import Ladder, amplitudes, rungs


# Past this many e-folds a barrier is shut; unclipped, exp overflows float32 at 88 and
# turns gradients into NaN.
_MAX_EFOLDS = 30.0


class CloudFunction(eqx.Module):
    """A `CloudFunction` holds the parameters of eq. (1).

    **Fields:**

    - `weights`: standard deviation of each ladder; the first is held at 1.
    - `persistences`: of each ladder, amplitude of an octave over the next longer one.
    - `gains`: a factor on the amplitude of each step of each ladder.
    - `mask_gain`: g, of the weather mask.
    - `threshold`: T.
    - `barrier_strength`: a, held at 1.
    - `base_m`, `top_m`: altitudes z_b and z_t of the condensation barriers.
    - `barrier_scale_m`: h.
    - `smoothing`: s₀, width of the level set that remains without any footprint.
    """

    weights: Float[Array, " ladders"]
    persistences: Float[Array, " ladders"]
    gains: Float[Array, " steps"]
    mask_gain: Float[Array, ""]
    threshold: Float[Array, ""]
    barrier_strength: Float[Array, ""]
    base_m: Float[Array, ""]
    top_m: Float[Array, ""]
    barrier_scale_m: Float[Array, ""]
    smoothing: Float[Array, ""]

    def __call__(
        self,
        fractal: Float[Array, "rays steps"],
        mask: Float[Array, "rays steps"],
        altitude_m: Float[Array, "rays steps"],
    ) -> Float[Array, "rays steps"]:
        """CF, in the cloud where positive.

        **Arguments:** `fractal`: Σ a_o N_o there.
        """
        below, above = self._barriers(altitude_m)
        return fractal + self.mask_gain * mask - below - above - self.threshold

    def amplitudes(self, ladders: tuple[Ladder, ...]) -> Float[Array, " rungs"]:
        """Return the amplitude a_o of each rung."""
        return amplitudes(ladders, self.weights, self.persistences, self.gains)

    def rise(
        self, altitude_m: Float[Array, "rays steps"]
    ) -> Float[Array, "rays steps"]:
        """Return what the barriers make of ∇CF per metre, along the vertical."""
        below, above = self._barriers(altitude_m)
        return (below - above) / self.barrier_scale_m

    @property
    def margin(self) -> Float[Array, ""]:
        """Give what textures and mask must exceed in the middle of the layer.

        T and the least of both barriers together.
        """
        thickness = (self.top_m - self.base_m) / self.barrier_scale_m
        barriers = 2 * self.barrier_strength * jnp.exp(-jnp.maximum(thickness, 0) / 2)
        return barriers + self.threshold

    def variance(self, ladders: tuple[Ladder, ...]) -> Float[Array, ""]:
        """Return that of CF where the mask is the same, without any footprint."""
        powers = jnp.asarray([rung.power for rung in rungs(ladders)], float)
        variance = self.smoothing**2 + self.amplitudes(ladders) ** 2 @ powers
        # The floor keeps the slope of the root finite where nothing varies.
        return jnp.maximum(variance, 1e-12)

    def reach_m(self, excess: Float[Array, " rays"]) -> Float[Array, " rays"]:
        """Return how far [m] beyond base and top the barriers leave it a chance.

        **Arguments:** `excess`: of textures and mask over T, at the most.
        """
        strength = jnp.maximum(excess / self.barrier_strength, 1.0)
        return self.barrier_scale_m * jnp.log(strength)

    def likelihood(
        self, mask: Float[Array, " rays"], ladders: tuple[Ladder, ...]
    ) -> Float[Array, " rays"]:
        """Estimate how likely cloud is in the middle of the layer, for normal noise."""
        spread = jnp.sqrt(self.variance(ladders))
        return ndtr((self.mask_gain * mask - self.margin) / spread)

    def _barriers(self, altitude_m):
        below = (self.base_m - altitude_m) / self.barrier_scale_m
        above = (altitude_m - self.top_m) / self.barrier_scale_m
        return (
            self.barrier_strength * jnp.exp(jnp.minimum(below, _MAX_EFOLDS)),
            self.barrier_strength * jnp.exp(jnp.minimum(above, _MAX_EFOLDS)),
        )
