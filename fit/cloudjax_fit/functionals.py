"""Linear functionals of the radiances of neighbouring pixels and bands.

A radiance is one, the difference of two pixels and the sum of two bands are others.
Histograms of increments see texture, which those of radiances do not; histograms of
two bands see how high thick cloud is (docs/statistics.md).
"""

import abc

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int


# Between pixels, in pixels. Each is twice the one before, as are rungs of textures.
LAGS = (1, 2, 4, 8, 16, 32)
# Of one lag and direction: those of a full disc would take tens of gigabytes.
MOST_PAIRS = 1_000_000


class Pairs(eqx.Module):
    """`Pairs` are pairs of pixels of one distance, for several distances.

    **Fields:** `first`, `second`: numbers of pixels; `known`: 1, or 0 for a pair that
    fills a row up.
    """

    first: Int[Array, "lags pairs"]
    second: Int[Array, "lags pairs"]
    known: Float[Array, "lags pairs"]

    @classmethod
    def of(
        cls,
        pairs: list[Int[np.ndarray, "2 _"]],
        known: Float[np.ndarray, " pixels"] | None = None,
    ) -> "Pairs":
        """Collect pairs, of one lag after the other, padded to equal length.

        **Arguments:** `known`: 0 for pixels whose pairs do not count; by default 1.
        """
        most = max((one.shape[1] for one in pairs), default=0)
        filled = np.zeros((len(pairs), 3, max(most, 1)), int)
        for row, one in zip(filled, pairs, strict=True):
            row[:2, : one.shape[1]], row[2, : one.shape[1]] = one, 1
        first, second, counted = (filled[:, i] for i in range(3))
        if known is not None and pairs:
            counted = counted * known[first] * known[second]
        first, second = jnp.asarray(first), jnp.asarray(second)
        return cls(first, second, jnp.asarray(counted, float))


def image_pairs(
    good: Bool[np.ndarray, "y x"], lags: tuple[int, ...], most: int = MOST_PAIRS
) -> list[Int[np.ndarray, "2 _"]]:
    """List pairs of good pixels, in rows and in columns, by lag.

    All of them, or where there are more than `most` in rows or in columns, every
    second, third or so.
    """
    number = np.arange(good.size).reshape(good.shape)
    found = []
    for lag in lags:
        pairs = []
        for swap in (False, True):
            known, own = (good.T, number.T) if swap else (good, number)
            both = known[:, :-lag] & known[:, lag:]
            ends = np.stack([own[:, :-lag][both], own[:, lag:][both]])
            pairs.append(ends[:, :: max(1, -(-ends.shape[1] // most))])
        found.append(np.concatenate(pairs, axis=1))
    return found


class Pixels(eqx.Module):
    """`Pixels` are those of an observed image, or the rays of a fit.

    **Fields:**

    - `radiance`: of each band, over its observed standard deviation.
    - `weights`: the share of each that is cloud.
    - `known`: 1 where the pixel counts.
    - `block`: of the image that it is in; `pairs`: of neighbours.
    """

    radiance: Float[Array, "bands pixels"]
    weights: Float[Array, " pixels"]
    known: Float[Array, " pixels"]
    block: Int[Array, " pixels"]
    pairs: Pairs


class Deposits(eqx.Module):
    """`Deposits` are what goes into the histograms of a functional.

    **Fields:** `values`, `weights` and `block` of each, by row.
    """

    values: Float[Array, "rows n"]
    weights: Float[Array, "rows n"]
    block: Int[Array, "rows n"]


class AbstractFunctional(eqx.Module):
    """A kind of linear functional; its rows are the single ones."""

    @abc.abstractmethod
    def __call__(self, pixels: Pixels) -> Deposits:
        """Find the functionals of pixels."""

    @abc.abstractmethod
    def rows(self, bands: tuple[int, ...]) -> list[str]:
        """Name the rows."""


class Values(AbstractFunctional):
    """`Values` are radiances, band by band."""

    def __call__(self, pixels: Pixels) -> Deposits:
        """Take the radiances of cloud."""
        return _of_pixels(pixels.radiance, pixels)

    def rows(self, bands: tuple[int, ...]) -> list[str]:
        """Name the bands."""
        return [f"C{band:02d}" for band in bands]


class CrossBands(AbstractFunctional):
    """`CrossBands` are sums and differences of two bands.

    **Fields:** `terms`: rows of two bands and the sign of the second.
    """

    terms: tuple[tuple[int, int, int], ...] = eqx.field(static=True)

    @classmethod
    def of(cls, count: int) -> "CrossBands":
        """Pair the first band with the last and with the one between."""
        terms = []
        if count >= 2:
            terms += [(0, count - 1, -1), (0, count - 1, 1)]
        if count >= 3:
            terms.append((0, 1, -1))
        return cls(tuple(terms))

    def __call__(self, pixels: Pixels) -> Deposits:
        """Combine the bands of cloud."""
        radiance = pixels.radiance
        values = jnp.stack([radiance[i] + s * radiance[j] for i, j, s in self.terms])
        return _of_pixels(values, pixels)

    def rows(self, bands: tuple[int, ...]) -> list[str]:
        """Name the combinations."""
        sign = {1: "+", -1: "-"}
        return [f"C{bands[i]:02d}{sign[s]}C{bands[j]:02d}" for i, j, s in self.terms]


class Increments(AbstractFunctional):
    """`Increments` are differences of pixels at each lag, on a scale that shows small
    and large ones.

    Rows are bands by lags, first of pairs that are cloud at both ends, then of those
    that are at one end at least.

    **Fields:** `size`: u = asinh(d/size); the observed median of |d|.
    """

    size: Float[Array, "bands lags"]

    def __call__(self, pixels: Pixels) -> Deposits:
        """Take the differences of all pairs."""
        pairs = pixels.pairs
        difference = increments(pixels)
        values = jnp.arcsinh(difference / self.size[..., None])
        first, second = pixels.weights[pairs.first], pixels.weights[pairs.second]
        both = first * second
        weights = jnp.stack([both, first + second - both]) * pairs.known[None]
        shape = (2, *values.shape)
        block = pixels.block[pairs.first]
        return Deposits(
            *(
                jnp.broadcast_to(part, shape).reshape(-1, shape[-1])
                for part in (values[None], weights[:, None], block[None, None])
            )
        )

    def rows(self, bands: tuple[int, ...]) -> list[str]:
        """Name bands and lags."""
        lags = self.size.shape[1]
        return [
            f"C{band:02d} lag {lag} {ends}"
            for ends in ("in cloud", "at cloud")
            for band in bands
            for lag in LAGS[:lags]
        ]


def increments(pixels: Pixels) -> Float[Array, "bands lags pairs"]:
    """Return the differences of the radiances of all pairs."""
    pairs = pixels.pairs
    return pixels.radiance[:, pairs.second] - pixels.radiance[:, pairs.first]


def _of_pixels(values: Float[Array, "rows pixels"], pixels: Pixels) -> Deposits:
    """Deposits of single pixels, the cloud of each alike in all rows."""
    weights = pixels.weights * pixels.known
    return Deposits(
        values,
        jnp.broadcast_to(weights, values.shape),
        jnp.broadcast_to(pixels.block, values.shape),
    )
