"""Statistics of pixels: what a fit compares, and how sure it is.

Each is found from sums over pixels, which are kept block by block of the image: the sum
of all blocks gives the statistic, and drawing blocks anew tells how sure it is.
"""

import abc

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .functionals import AbstractFunctional, Pixels, increments
from .histogram import Bins, cumulative, deposit


# A residual of 1 is a difference of 1/SCALE between the cumulative histograms, what
# some thousand independent pixels leave undecided; it weighs as much as one standard
# deviation of a prior.
SCALE = 60.0
# Increments of neighbouring pixels and combinations of bands go together: at the scale
# of radiances their many histograms drown those (docs/decisions.md).
CROSS_SCALE = 30.0
INCREMENT_SCALES = 15.0, 25.0
# Of logarithms of mean squares and of edge shares.
LOG_SCALE = 10.0
# The covered share of the whole sky is one number beside the bins of a histogram.
COVERAGE_SCALE = 2 * SCALE
# A share of edges or a mean square of less than this is none.
_NONE = 1e-6


class AbstractStatistic(eqx.Module):
    """A statistic describes all pixels by numbers that are found by way of sums.

    **Fields:** `observed`: the sums of the observed image, block by block.
    """

    observed: eqx.AbstractVar[Float[Array, "blocks rows parts"]]

    @abc.abstractmethod
    def sums(self, pixels: Pixels, blocks: int) -> Float[Array, "{blocks} rows parts"]:
        """Add up what pixels contribute, block by block."""

    @abc.abstractmethod
    def numbers(self, sums: Float[Array, "rows parts"]) -> Float[Array, " numbers"]:
        """Return what a fit compares, in units of what it leaves undecided."""

    def residuals(
        self, sums: Float[Array, "blocks rows parts"]
    ) -> Float[Array, " numbers"]:
        """Return simulated less observed."""
        return self.numbers(sums.sum(0)) - self.numbers(self.observed.sum(0))


class Histograms(AbstractStatistic):
    """`Histograms` are the cumulative histograms of a functional.

    **Fields:** `functional`; `bins` and `scale` of each of its rows.
    """

    functional: AbstractFunctional
    bins: Bins
    scale: Float[Array, " rows"]
    observed: Float[Array, "blocks rows bins"]

    def sums(self, pixels: Pixels, blocks: int) -> Float[Array, "{blocks} rows bins"]:
        """Deposit the functional in bins."""
        found = self.functional(pixels)

        def of_row(values, weights, block, bins):
            return deposit(values, weights, bins, block, blocks)

        rows = jax.vmap(of_row)(found.values, found.weights, found.block, self.bins)
        return jnp.moveaxis(rows, 1, 0)

    def numbers(self, sums: Float[Array, "rows bins"]) -> Float[Array, " numbers"]:
        """Return the cumulative histograms."""
        return (self.scale[:, None] * jax.vmap(cumulative)(sums)).reshape(-1)


class Ratios(AbstractStatistic):
    """`Ratios` are ratios of two sums: mean squares, and shares."""

    def numbers(self, sums: Float[Array, "rows 2"]) -> Float[Array, " rows"]:
        """Return scaled logarithms of the ratios."""
        counted = jnp.maximum(sums[:, 1], 1.0)
        return LOG_SCALE * jnp.log(jnp.maximum(sums[:, 0] / counted, _NONE))


class MeanSquares(Ratios):
    """`MeanSquares` are those of the increments of all pairs, by band and lag."""

    observed: Float[Array, "blocks rows 2"]

    def sums(self, pixels: Pixels, blocks: int) -> Float[Array, "{blocks} rows 2"]:
        """Add up squares and pairs."""
        known = pixels.pairs.known
        squares = increments(pixels) ** 2 * known[None]
        return _by_block(squares, known, pixels, blocks)


class EdgeShares(Ratios):
    """`EdgeShares` tell how often just one of two pixels is cloud, by lag."""

    observed: Float[Array, "blocks rows 2"]

    def sums(self, pixels: Pixels, blocks: int) -> Float[Array, "{blocks} rows 2"]:
        """Add up edges and pairs."""
        pairs = pixels.pairs
        first, second = pixels.weights[pairs.first], pixels.weights[pairs.second]
        edges = (first + second - 2 * first * second) * pairs.known
        return _by_block(edges[None], pairs.known, pixels, blocks)


class Coverage(AbstractStatistic):
    """The `Coverage` is the share of the sky that is cloud."""

    observed: Float[Array, "blocks 1 2"]

    def sums(self, pixels: Pixels, blocks: int) -> Float[Array, "{blocks} 1 2"]:
        """Add up cloud and pixels."""
        parts = jnp.stack([pixels.weights * pixels.known, pixels.known], axis=-1)
        none = jnp.zeros((blocks, 2), parts.dtype)
        return none.at[pixels.block].add(parts)[:, None]

    def numbers(self, sums: Float[Array, "1 2"]) -> Float[Array, " 1"]:
        """Return the share."""
        return COVERAGE_SCALE * sums[:, 0] / jnp.maximum(sums[:, 1], 1.0)


def _by_block(of_pairs: Float[Array, "bands lags pairs"], known, pixels, blocks: int):
    """Sums over pairs, and how many there are, [blocks rows 2]."""
    block = pixels.block[pixels.pairs.first]

    def of_lag(values, number):
        return jnp.zeros(blocks, values.dtype).at[number].add(values)

    by_lag = jax.vmap(of_lag)
    totals = jax.vmap(by_lag, (0, None))(of_pairs, block)
    counts = jnp.broadcast_to(by_lag(known, block), totals.shape)
    rows = jnp.stack([totals, counts], axis=-1).reshape(-1, blocks, 2)
    return jnp.moveaxis(rows, 1, 0)


class Statistics(eqx.Module):
    """`Statistics` are all that a fit compares.

    **Fields:**

    - `deviations`: observed, of the radiances of each band, by which they are divided.
    - `lags`: between pixels; none where texture is not compared.
    - `parts`: the statistics, and `coverage`.
    """

    deviations: Float[Array, " bands"]
    parts: tuple[AbstractStatistic, ...]
    coverage: Coverage
    lags: tuple[int, ...] = eqx.field(static=True)

    @property
    def all(self) -> tuple[AbstractStatistic, ...]:
        """List every one, the coverage last."""
        return (*self.parts, self.coverage)

    def sums(self, pixels: Pixels, blocks: int) -> list[Float[Array, "blocks _ _"]]:
        """Add up what pixels contribute to each."""
        return [one.sums(pixels, blocks) for one in self.all]

    def values_alone(self) -> "Statistics":
        """Compare the radiances of single pixels and the coverage, and no texture."""
        return Statistics(self.deviations, self.parts[:1], self.coverage, ())
