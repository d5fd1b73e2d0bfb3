"""The soft level set: which share of a pixel's way is cloud, from CF along it."""

import math
from statistics import NormalDist

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float


# Beyond this many widths the level set is decided: erf is 1 to float32.
_MAX_WIDTHS = 8.0
# A change of CF within one step that is as good as a jump.
_MAX_CHANGE = 6.0
# The shortest line within a step, in widths of the noise.
_LEAST_CHANGE = 0.4


class Latent(eqx.Module):
    """A `Latent` is what a pixel does not resolve: a standard Gaussian, by quadrature.

    Averaging the noise over the footprint removes variance from CF. The part that all
    points of a ray within the cloud have in common enters as a Gaussian latent,
    radiances being averaged over its nodes; the rest widens the level set.

    **Fields:** `nodes`, `weights` of the quadrature.
    """

    nodes: Float[Array, " nodes"]
    weights: Float[Array, " nodes"]

    @staticmethod
    def equal_shares(count: int = 5) -> "Latent":
        """Make a node in the middle of each of so many equal shares of probability.

        A node is the mean of its share: n (φ(a) - φ(b)) between quantiles a and b.
        Radiances are nearly steps of the latent where cloud is thick, and steps are
        met best by nodes that stand for as much each.
        """
        normal = NormalDist()
        edges = [normal.inv_cdf(i / count) for i in range(1, count)]
        density = np.array([0.0, *map(normal.pdf, edges), 0.0])
        nodes = count * (density[:-1] - density[1:])
        return Latent(jnp.asarray(nodes, float), jnp.full(count, 1 / count))

    @staticmethod
    def gauss_hermite(count: int = 5) -> "Latent":
        """Make so many nodes of Gauss and Hermite, for what is smooth in the latent."""
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
    width = jnp.sqrt(jnp.maximum(own, 1e-12))[:, None]
    shift = jnp.sqrt(jnp.maximum(common, 1e-12))[:, None]
    shifted = value[None] + latent.nodes[:, None, None] * shift[None]
    return shifted, _above(shifted, _changes(value), width)


def _changes(value: Float[Array, "rays steps"]) -> Float[Array, "rays steps"]:
    """By how much CF changes within each step, as from its neighbours.

    The harmonic mean of the changes on both sides (as van Leer 1974, J. Comput. Phys.
    14, 361, limits slopes): where a barrier shuts within a step, a plain mean reaches
    far into the next. Where CF turns, it goes half of the way and back.
    """
    if value.shape[-1] == 1:
        return jnp.zeros_like(value)
    # Where a barrier shuts within one step, no line can say where.
    signed = jnp.clip(jnp.diff(value, axis=-1), -_MAX_CHANGE, _MAX_CHANGE)
    change = jnp.abs(signed)
    turns = signed[:, :-1] * signed[:, 1:] < 0
    inner = _harmonic_mean(change[:, :-1], change[:, 1:]) * jnp.where(turns, 0.5, 1.0)
    return jnp.concatenate([change[:, :1], inner, change[:, -1:]], axis=-1)


@jax.custom_jvp
def _harmonic_mean(a: Array, b: Array) -> Array:
    """2ab / (a + b) of what is not negative; 0 where both are."""
    return 2 * a * (b / _sum(a, b))


@_harmonic_mean.defjvp
def _harmonic_mean_jvp(primals, tangents):
    """Without the cancellation in the derivative of a quotient."""
    (a, b), (along_a, along_b) = primals, tangents
    part_a, part_b = a / _sum(a, b), b / _sum(a, b)
    slope = 2 * (part_b**2 * along_a + part_a**2 * along_b)
    return _harmonic_mean(a, b), slope


def _sum(a: Array, b: Array) -> Array:
    return jnp.where(a + b > 0, a + b, 1.0)


def _above(
    middle: Float[Array, "nodes rays steps"],
    change: Float[Array, "rays steps"],
    width: Float[Array, "rays 1"],
) -> Float[Array, "nodes rays steps"]:
    """The share of a step on which a straight line and normal noise are above 0.

    It makes the share of a step that is cloud right where the level set cuts it, so
    that the march converges with the square of the step; and where it does not, there
    is none. A wider Φ would have tails there, of which thick cloud makes much.
    """
    # A line is never so short that differences are lost in rounding; the noise gives
    # away what that adds to the variance.
    least = (_LEAST_CHANGE * width) ** 2
    added = least * (least / (least + change**2))
    length, rest = jnp.sqrt(change**2 + added), jnp.sqrt(width**2 - added / 12)
    every = jnp.broadcast_to(length[None], middle.shape)
    return _mean_cdf(middle, every, jnp.broadcast_to(rest[None], middle.shape))


@jax.custom_jvp
def _mean_cdf(middle: Array, length: Array, width: Array) -> Array:
    """The mean of Φ(x / width) where x is at most half of `length` from `middle`.

    By G(x) = xΦ(x) + φ(x), whose slope is Φ: (G(b) - G(a)) / (b - a) between the ends a
    and b, in widths. What is far from 0 of that is a ramp, and rounding leaves nothing
    of the rest.
    """
    return _mean_and_ends(middle, length, width)[0]


@_mean_cdf.defjvp
def _mean_cdf_jvp(primals, tangents):
    """Slopes are differences of Φ and of φ; those of the terms of G nearly cancel."""
    _, length, _ = primals
    mean, cdf, density = _mean_and_ends(*primals)
    slopes = cdf[1] - cdf[0], (cdf[0] + cdf[1]) / 2 - mean, density[1] - density[0]
    total = sum(slope * along for slope, along in zip(slopes, tangents, strict=True))
    return mean, total / length


def _mean_and_ends(middle: Array, length: Array, width: Array):
    """The mean of Φ; Φ and φ at both ends."""
    first, last = middle - length / 2, middle + length / 2
    ramp = jnp.clip(last, 0.0, length) / length
    below, *low = _of_end(first / width)
    above, *high = _of_end(last / width)
    mean = jnp.clip(ramp + (above - below) * (width / length), 0.0, 1.0)
    return (mean, *zip(low, high, strict=True))


def _of_end(x: Array) -> tuple[Array, Array, Array]:
    """G(x) - max(x, 0) = φ(x) - |x| Φ(-|x|); Φ(x) and φ(x)."""
    far = jnp.minimum(jnp.abs(x), _MAX_WIDTHS)
    # jax.scipy's ndtr keeps the far tails to all digits, at three times the price.
    half = 0.5 * jax.lax.erf(math.sqrt(0.5) * far)
    density = (1 / math.sqrt(2 * math.pi)) * jnp.exp(-0.5 * far**2)
    return density - far * (0.5 - half), 0.5 + jnp.sign(x) * half, density
