"""Histograms of radiances: differentiable ones for the fit, statistics for its report.

The first half runs in JAX, inside the objective. The second half runs on the host in
float64 and judges the result with code that the fit does not share.
"""

import math
from dataclasses import dataclass
from typing import TypeAlias

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import scipy.stats
from jax.core import Tracer
from jaxtyping import Array, Float, Int, Num


def _floating(x) -> Array:
    x = jnp.asarray(x)
    return x if jnp.issubdtype(x.dtype, jnp.floating) else x.astype(float)


class Bins(eqx.Module):
    """`Bins` divide the radiances of one band into equal parts.

    `low` and `high` are the outer edges, in the units of the radiances. One `Bins` may
    hold several bands (`low` and `high` of shape `[bands]`) for use under `jax.vmap`.
    """

    low: Float[Array, "*bands"] = eqx.field(converter=_floating)
    high: Float[Array, "*bands"] = eqx.field(converter=_floating)
    count: int = eqx.field(static=True, default=64)

    def __check_init__(self):
        if self.count < 3:
            raise ValueError(f"a histogram needs at least 3 bins, not {self.count}")
        span = self.high - self.low
        if not isinstance(span, Tracer) and not np.all(np.asarray(span) > 0):
            raise ValueError(
                f"the bins run from {self.low} to {self.high}: high must exceed low"
            )

    @property
    def width(self) -> Float[Array, "*bands"]:
        """Give the width of one bin."""
        return (self.high - self.low) / self.count

    @property
    def edges(self) -> Float[Array, "*bands edges"]:
        """Give the edges of the bins, from `low` to `high`."""
        return jnp.linspace(self.low, self.high, self.count + 1, axis=-1)


def spline_histogram(
    values: Float[Array, " n"], weights: Float[Array, " n"], bins: Bins
) -> Float[Array, " bins"]:
    """Deposit each weight on the three bins nearest to its value.

    The shares are a quadratic B-spline of the distance to their centres (the
    "triangular-shaped cloud" of Hockney & Eastwood 1988, section 5-3). They conserve
    the total weight and, away from the outer bins, the weighted mean, and their
    derivative is continuous: with the linear deposit it jumps whenever a value passes a
    centre, and a solver sees dents in the objective that are not there.

    Values beyond the last but one centres are drawn there, and there the derivative is
    zero: `bins` should cover what a fit can reach.

    A pixel of weight 0 may hold NaN or infinity: it changes neither the histogram nor
    any derivative. A NaN of positive weight gives NaN, so that it cannot hide.

    Use `jax.vmap` for several bands.
    """
    return deposit(values, weights, bins, jnp.zeros(values.shape, int), 1)[0]


def deposit(
    values: Float[Array, " n"],
    weights: Float[Array, " n"],
    bins: Bins,
    block: Int[Array, " n"],
    blocks: int,
) -> Float[Array, "{blocks} bins"]:
    """Deposit as `spline_histogram`, in a histogram for each block of the image."""
    unseen = (weights == 0) & ~jnp.isfinite(values)
    values = jnp.where(unseen, bins.low, values)
    position = (values - bins.low) / bins.width - 0.5
    position = jnp.clip(position, 1, bins.count - 2)
    # The second clip keeps the index of a NaN, which is any integer at all, in range.
    nearest = jnp.clip(jnp.round(position).astype(int), 1, bins.count - 2)
    offset = position - nearest
    to_left = weights * (0.5 - offset) ** 2 / 2
    to_right = weights * (0.5 + offset) ** 2 / 2
    # Subtracting, rather than weights * (3/4 - offset²), loses no weight to rounding.
    to_nearest = weights - to_left - to_right
    place = block * bins.count + nearest
    empty = jnp.zeros(blocks * bins.count, to_left.dtype)
    deposited = empty.at[place].add(to_nearest)
    deposited = deposited.at[place - 1].add(to_left).at[place + 1].add(to_right)
    return deposited.reshape(blocks, bins.count)


def cumulative(histogram: Float[Array, " bins"]) -> Float[Array, " bins"]:
    """Return the cumulative histogram over its total weight: it rises to 1 in the last
    bin.

    The mean absolute difference of two of these, times the span of the bins, is the
    1-Wasserstein distance of the binned values. A histogram without weight gives zeros,
    with zero derivative.
    """
    total = histogram.sum()
    # The derivative of the quotient holds total**-2, which overflows long before total
    # itself vanishes.
    enough = total > math.sqrt(jnp.finfo(histogram.dtype).tiny)
    return jnp.where(enough, jnp.cumsum(histogram), 0) / jnp.where(enough, total, 1)


@dataclass(frozen=True, eq=False)
class Quantiles:
    """A sample reduced to its quantile function, small enough to keep in a repository.

    `probabilities` rise within [0, 1]; `values` are the quantiles there, in the units
    of the sample; `count` is the number of pixels that were reduced to the table.
    """

    probabilities: Float[np.ndarray, " levels"]
    values: Float[np.ndarray, " levels"]
    count: int

    def __post_init__(self):
        p, values = self.probabilities, self.values
        if p.shape != values.shape or p.size == 0:
            raise ValueError("a quantile table needs one value for each probability")
        if p[0] < 0 or p[-1] > 1 or np.any(np.diff(p) <= 0):
            raise ValueError("the probabilities of a quantile table rise from 0 to 1")
        if np.any(np.diff(values) < 0):
            raise ValueError("the values of a quantile table never decrease")

    def equal_weights(self, size: int = 4000) -> Float[np.ndarray, " {size}"]:
        """Return `size` values of equal weight with this distribution."""
        # Midpoints in probability keep the mean of the piecewise linear function.
        middle = (np.arange(size) + 0.5) / size
        return np.interp(middle, self.probabilities, self.values)


Pixels: TypeAlias = Num[np.ndarray, " _"] | Num[Array, " _"]


@dataclass(frozen=True, eq=False)
class Sample:
    """A `Sample` holds radiances of pixels with their weights, all finite, in float64.

    `count` is the number of pixels behind it, which exceeds the number of `values` when
    these come from a quantile table.
    """

    values: Float[np.ndarray, " n"]
    weights: Float[np.ndarray, " n"]
    count: int

    @property
    def mean(self) -> float:
        """Give the weighted mean."""
        return float(np.average(self.values, weights=self.weights))

    @property
    def std(self) -> float:
        """Give the weighted standard deviation of the population."""
        variance = np.average((self.values - self.mean) ** 2, weights=self.weights)
        return math.sqrt(variance)

    def cdf(self, at: Float[np.ndarray, " m"]) -> Float[np.ndarray, " m"]:
        """Return the fraction of the weight that lies at or below each of `at`."""
        order = np.argsort(self.values)
        mass = np.concatenate([[0.0], np.cumsum(self.weights[order])])
        below = np.searchsorted(self.values[order], at, side="right")
        return mass[below] / mass[-1]

    def quantile(self, probability: float) -> float:
        """Return the smallest value that has `probability` of the weight at or below
        it.
        """
        order = np.argsort(self.values)
        mass = np.cumsum(self.weights[order])
        index = np.searchsorted(mass, probability * mass[-1])
        return float(self.values[order][min(index, order.size - 1)])


def sample_of(
    source: Pixels | Quantiles, weights: Pixels | None = None, name: str = "sample"
) -> Sample:
    """Bring pixels or a quantile table into the form that statistics are taken of.

    Pixels of weight 0 are left out, whatever they hold.

    Raises `ValueError`, naming the sample by `name`, when nothing is left, when a
    remaining value or a weight is not finite, or when a weight is negative.
    """
    if isinstance(source, Quantiles):
        values = source.equal_weights()
    else:
        values = np.asarray(source, np.float64)
    masses = np.ones_like(values) if weights is None else np.asarray(weights, float)
    if masses.shape != values.shape:
        raise ValueError(
            f"the {name} has {values.size} values but {masses.size} weights"
        )
    if not np.isfinite(masses).all() or (masses < 0).any():
        raise ValueError(f"the weights of the {name} must be finite and not negative")
    seen = masses > 0
    if not seen.any():
        raise ValueError(f"the {name} holds no pixels of positive weight")
    if not np.isfinite(values[seen]).all():
        raise ValueError(
            f"the {name} holds values that are not finite: mask these pixels first"
        )
    count = source.count if isinstance(source, Quantiles) else int(seen.sum())
    return Sample(values[seen], masses[seen], count)


def quantiles(
    values: Pixels, count: int = 1001, weights: Pixels | None = None
) -> Quantiles:
    """Reduce pixels to `count` quantiles, evenly spaced from minimum to maximum.

    With `weights`, each pixel stands for the part of the distribution that its weight
    is of all.

    Raises `ValueError` when `values` is empty or not finite.
    """
    sample = sample_of(values, weights)
    probabilities = np.linspace(0.0, 1.0, count)
    order = np.argsort(sample.values)
    ranked, mass = sample.values[order], sample.weights[order]
    # The first value is at 0 and the last at 1, as numpy has it for equal weights.
    middle = np.cumsum(mass) - mass / 2
    span = middle[-1] - middle[0]
    place = (middle - middle[0]) / span if span > 0 else np.zeros(len(ranked))
    table = np.interp(probabilities, place, ranked)
    # Interpolation between equal values may round below the first of them.
    return Quantiles(probabilities, np.maximum.accumulate(table), sample.count)


@dataclass(frozen=True)
class Distances:
    """`Distances` say how far a simulated sample is from an observed one.

    - `w1`: 1-Wasserstein distance, in radiance units.
    - `w1_over_std`: the same over the standard deviation of the observed sample; NaN
        when all observed values are equal.
    - `ks`: Kolmogorov-Smirnov distance, the largest difference of the two CDFs.
    - `bias`: simulated mean less observed mean, in radiance units.
    - `std_observed`: standard deviation of the observed sample, in radiance units.
    - `n_observed`, `n_simulated`: numbers of pixels of positive weight.
    """

    w1: float
    w1_over_std: float
    ks: float
    bias: float
    std_observed: float
    n_observed: int
    n_simulated: int


def distances(
    observed: Pixels | Quantiles,
    simulated: Pixels | Quantiles,
    simulated_weights: Pixels | None = None,
) -> Distances:
    """Compare two samples of radiances in the same units, pixels or quantile tables.

    Raises `ValueError` when either is empty or not finite.
    """
    a = sample_of(observed, name="observed sample")
    b = sample_of(simulated, simulated_weights, name="simulated sample")
    w1 = scipy.stats.wasserstein_distance(a.values, b.values, a.weights, b.weights)
    everywhere = np.union1d(a.values, b.values)
    return Distances(
        w1=float(w1),
        w1_over_std=float(w1) / a.std if a.std > 0 else math.nan,
        ks=float(np.abs(a.cdf(everywhere) - b.cdf(everywhere)).max()),
        bias=b.mean - a.mean,
        std_observed=a.std,
        n_observed=a.count,
        n_simulated=b.count,
    )
