"""From the radiances of a scene to the target of a fit."""

from collections.abc import Iterable, Mapping

import numpy as np

from cloudjax import CloudClass
from cloudjax_data import AbiScene, WeatherCube
from cloudjax_scenes.cloud_rule import CloudRule
from cloudjax_scenes.imagery_reduction import reduce_scene

from .histogram import quantiles
from .targets import BINS, BandStatistics, Target, block_of_pixels


BLOCKS = (8, 8)
FEWEST_CLOUD_PIXELS = 500


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
    block = block_of_pixels(reduced.imagery.grid.shape, BLOCKS)
    count = BLOCKS[0] * BLOCKS[1]
    cloud = reduced.cloud.reshape(-1)
    return Target(
        imagery=reduced.imagery,
        statistics={
            n: _statistics(radiance.reshape(-1)[cloud], block[cloud], count)
            for n, radiance in reduced.radiance.items()
        },
        blocks=BLOCKS,
        block_cloud=np.bincount(block[cloud], minlength=count),
        block_valid=np.bincount(block[reduced.good.reshape(-1)], minlength=count),
        good=reduced.good,
    )


def _statistics(radiance, block, count: int) -> BandStatistics:
    radiance = np.asarray(radiance, np.float64)
    table = quantiles(radiance)
    span = table.values[-1] - table.values[0]
    low, high = table.values[0] - 0.1 * span, table.values[-1] + 0.1 * span
    edges = [np.arange(count + 1) - 0.5, np.linspace(low, high, BINS + 1)]
    counts, _, _ = np.histogram2d(block, radiance, bins=edges)
    return BandStatistics(
        quantiles=table,
        low=float(low),
        high=float(high),
        block_counts=counts.astype(np.int64),
    )
