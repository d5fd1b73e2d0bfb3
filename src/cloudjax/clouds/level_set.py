"""The soft level set: which share of a pixel's way is cloud, from CF along it."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float


# Beyond this many widths the level set is decided: erf is 1 to float32.
_MAX_WIDTHS = 8.0
# A change of CF within one step that is as good as a jump.
_MAX_CHANGE = 6.0


class Latent(eqx.Module):
    """What a pixel does not resolve: one standard Gaussian per ray, by quadrature.

    Averaging the noise over the footprint removes variance from CF. The part that all
    points of a ray within the cloud have in common enters as a Gaussian latent,
    radiances being averaged over its Gauss-Hermite nodes; the rest widens the level
    set.

    **Fields:** `nodes`, `weights` of the quadrature.
    """

    nodes: Float[Array, " nodes"]
    weights: Float[Array, " nodes"]

    @staticmethod
    def gauss_hermite(count: int = 5) -> "Latent":
        nodes, weights = np.polynomial.hermite_e.hermegauss(count)
        return Latent(
            jnp.asarray(nodes, float), jnp.asarray(weights / weights.sum(), float)
        )


def level_set(
    value: Float[Array, "rays steps"],
    common: Float[Array, " rays"],
    own: Float[Array, " rays"],
    latent: Latent,
) -> tuple[Float[Array, "nodes rays steps"], Float[Array, "nodes rays steps"]]:
    """Return CF at each node, and the share of each step that is cloud there.

    **Arguments:** `value`: CF; `common`, `own`: variance that the pixel averages, of
    what all points of a ray have in common and of the rest.
    """
    if latent.nodes.shape[0] == 1:
        common, own = jnp.zeros_like(common), own + common
    # The floors keep the slopes of the roots finite where nothing is lost.
    width = jnp.sqrt(jnp.maximum(own[:, None] + _spread_of_steps(value), 1e-12))
    shift = jnp.sqrt(jnp.maximum(common, 1e-12))[:, None]
    shifted = value[None] + latent.nodes[:, None, None] * shift[None]
    widths = jnp.clip(shifted / width[None], -_MAX_WIDTHS, _MAX_WIDTHS)
    # jax.scipy's ndtr keeps the far tails to all digits, at three times the price.
    return shifted, 0.5 + 0.5 * jax.lax.erf(np.sqrt(0.5) * widths)


def _spread_of_steps(value: Float[Array, "rays steps"]) -> Float[Array, "rays steps"]:
    """Variance of CF within each step, as of a straight line: (change)²/12.

    It makes the share of a step that is cloud right where the level set cuts it, so
    that the march converges with the square of the step.
    """
    if value.shape[-1] == 1:
        return jnp.zeros_like(value)
    change = jnp.diff(value, axis=-1)
    inner = (change[:, 1:] + change[:, :-1]) / 2
    whole = jnp.concatenate([change[:, :1], inner, change[:, -1:]], axis=-1)
    # Where a barrier shuts within one step, no width can say where.
    return jnp.minimum(jnp.abs(whole), _MAX_CHANGE) ** 2 / 12
