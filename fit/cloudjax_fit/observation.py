"""The radiances of a scene become the target of a fit."""

from collections.abc import Iterable, Mapping

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from cloudjax import CloudClass
from cloudjax_data import AbiScene, WeatherCube
from cloudjax_scenes.cloud_rule import CloudRule
from cloudjax_scenes.imagery import Imagery
from cloudjax_scenes.imagery_reduction import reduce_scene

from .functionals import (
    LAGS,
    CrossBands,
    Increments,
    Pairs,
    Pixels,
    Values,
    image_pairs,
    increments,
)
from .histogram import Bins, Quantiles, quantiles
from .statistics import (
    CROSS_SCALE,
    INCREMENT_SCALES,
    SCALE,
    AbstractStatistic,
    Coverage,
    EdgeShares,
    Histograms,
    MeanSquares,
    Statistics,
)
from .targets import Target, block_of_pixels


BLOCKS = (8, 8)
FEWEST_CLOUD_PIXELS = 500
# Broad enough to hold dozens of rays each: with fewer, the derivative of a histogram
# jumps as rays change bins, and a solver creeps.
BINS = 32
INCREMENT_BINS = 24
# Pixels that are cloud with less weight than this are none.
_LEAST_WEIGHT = 1e-3
# An image holds so many of the largest lag at least.
_LAGS_IN_IMAGE = 8
# Values that differ by less than this part of them are one value: noise is more.
_ALIKE = 1e-3
# Bins reach beyond what is observed, by this part of it.
_BEYOND = 0.1
_QUANTILE = 0.995


def observe(
    scene: AbiScene,
    bands: Iterable[int] | None = None,
    rule: CloudRule | None = None,
    classes: Mapping[str, CloudClass] | None = None,
    weather: WeatherCube | None = None,
) -> Target:
    """Reduce a scene to a target.

    **Arguments:** as of `cloudjax_scenes.reduce_scene`.

    **Raises:** `DataError` for what `reduce_scene` does, with too few cloud pixels to
    fit.
    """
    reduced = reduce_scene(
        scene,
        bands,
        rule,
        classes,
        weather=weather,
        fewest_cloud_pixels=FEWEST_CLOUD_PIXELS,
    )
    return target_of(reduced.imagery, reduced.radiance, reduced.good, BLOCKS)


def target_of(
    imagery: Imagery,
    radiance: Mapping[int, Float[np.ndarray, "y x"]],
    good: Bool[np.ndarray, "y x"],
    blocks: tuple[int, int] = BLOCKS,
) -> Target:
    """Find the statistics of an image.

    Pixels count as cloud with the soft weights that simulated ones get: with sharp ones
    the very clouds of the image would not fit it.

    **Arguments:** `radiance`: by band; `good`: the pixels that count.
    """
    scene = imagery.empty_scene
    numbers = scene.bands
    seen = np.stack([np.asarray(radiance[n], float) for n in numbers])
    known = np.where(good, seen, 0.0).reshape(len(numbers), -1)
    weights = np.asarray(imagery.rule.weights(jnp.asarray(known, float), scene))
    weights = np.where((weights > _LEAST_WEIGHT) & good.reshape(-1), weights, 0.0)
    tables = {n: _table(known[i], weights) for i, n in enumerate(numbers)}
    deviations = np.array(
        [max(table.equal_weights().std(), _ALIKE * abs(table.values).max(), 1e-9)
         for table in tables.values()]
    )  # fmt: skip
    lags = tuple(lag for lag in LAGS if lag * _LAGS_IN_IMAGE <= min(good.shape))
    pixels = Pixels(
        radiance=jnp.asarray(known / deviations[:, None], float),
        weights=jnp.asarray(weights, float),
        known=jnp.asarray(good.reshape(-1), float),
        block=jnp.asarray(block_of_pixels(good.shape, blocks)),
        pairs=Pairs.of(image_pairs(good, lags)),
    )
    statistics = _statistics(pixels, tables, deviations, lags, blocks[0] * blocks[1])
    return Target(imagery, tables, statistics, blocks, good)


def _table(values, weights) -> Quantiles:
    table = quantiles(values, weights=weights)
    return Quantiles(table.probabilities, table.values, round(float(weights.sum())))


def _statistics(
    pixels: Pixels, tables, deviations, lags: tuple[int, ...], blocks: int
) -> Statistics:
    ends = [(table.values[0], table.values[-1]) for table in tables.values()]
    low, high = (np.array(side) / deviations for side in zip(*ends, strict=True))
    beyond = _BEYOND * _span(low, high)
    low, high = low - beyond, high + beyond
    parts: list[AbstractStatistic] = [
        _histograms(Values(), low, high, SCALE, BINS, pixels, blocks)
    ]
    cross = CrossBands.of(len(deviations))
    if cross.terms:
        sums = cross(pixels)
        ends = [
            _ends(v, w, 0.0) for v, w in zip(sums.values, sums.weights, strict=True)
        ]
        low, high = (np.array(side) for side in zip(*ends, strict=True))
        parts.append(_histograms(cross, low, high, CROSS_SCALE, BINS, pixels, blocks))
    if lags:
        parts += _texture(pixels, blocks)
    return Statistics(
        jnp.asarray(deviations, float),
        tuple(parts),
        _of(Coverage, pixels, blocks),
        lags,
    )


def _texture(pixels: Pixels, blocks: int) -> list[AbstractStatistic]:
    difference = np.abs(np.asarray(increments(pixels)))
    pairs = pixels.pairs
    ends = [
        np.asarray(pixels.weights)[np.asarray(i)] for i in (pairs.first, pairs.second)
    ]
    cloud = (ends[0] * ends[1] > 0.5) & (np.asarray(pairs.known) > 0)
    size = np.array(
        [
            [np.median(row[some]) if some.any() else 1.0
             for row, some in zip(band, cloud, strict=True)]
            for band in difference
        ]
    )  # fmt: skip
    functional = Increments(jnp.asarray(np.maximum(size, 1e-4), float))
    found = functional(pixels)
    ends = [_ends(np.abs(v), w, 1 - _QUANTILE)
            for v, w in zip(found.values, found.weights, strict=True)]  # fmt: skip
    high = np.array([high for _, high in ends])
    scale = np.repeat(INCREMENT_SCALES, size.size)
    return [
        _histograms(functional, -high, high, scale, INCREMENT_BINS, pixels, blocks),
        _of(MeanSquares, pixels, blocks),
        _of(EdgeShares, pixels, blocks),
    ]


def _ends(values, weights, left_out: float) -> tuple[float, float]:
    """Of bins, a little beyond all values but those that are left out."""
    some = np.asarray(values, float)[np.asarray(weights) > 0.5]
    if some.size == 0:
        return 0.0, 1.0
    low, high = np.quantile(some, [left_out, 1 - left_out])
    beyond = _BEYOND * _span(low, high)
    return float(low - beyond), float(high + beyond)


def _span(low, high):
    """Of values: wide enough for bins that single precision can tell apart."""
    largest = np.maximum(np.abs(low), np.abs(high))
    return np.maximum(high - low, np.maximum(_ALIKE * largest, 1e-6))


def _histograms(functional, low, high, scale, count, pixels, blocks) -> Histograms:
    bins = Bins(jnp.asarray(low, float), jnp.asarray(high, float), count)
    scales = jnp.broadcast_to(jnp.asarray(scale, float), bins.low.shape)
    empty = jnp.zeros((blocks, len(scales), count))
    return _filled(
        Histograms(functional=functional, bins=bins, scale=scales, observed=empty),
        pixels,
        blocks,
    )


def _of(kind, pixels: Pixels, blocks: int):
    return _filled(kind(jnp.zeros((blocks, 1, 2))), pixels, blocks)


def _filled(statistic, pixels: Pixels, blocks: int):
    sums = statistic.sums(pixels, blocks)
    return eqx.tree_at(lambda s: s.observed, statistic, sums)
