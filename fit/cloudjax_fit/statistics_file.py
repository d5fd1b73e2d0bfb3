"""Statistics of a target as groups of a netCDF file.

Sums over pixels are rounded to tenths of one; the rest is kept as it is.
"""

from typing import Any

import jax.numpy as jnp
import numpy as np
import xarray as xr

from .functionals import AbstractFunctional, CrossBands, Increments, Values
from .histogram import Bins
from .statistics import (
    AbstractStatistic,
    Coverage,
    EdgeShares,
    Histograms,
    MeanSquares,
    Statistics,
)


STATISTICS = "statistics"
_NAMES = {Values: "values", CrossBands: "cross_bands", Increments: "increments"}
_RATIOS = {MeanSquares: "mean_squares", EdgeShares: "edge_shares", Coverage: "coverage"}


def statistics_groups(statistics: Statistics) -> dict[str, xr.Dataset]:
    """Return the groups of a file that hold the statistics."""
    groups = {
        f"/{STATISTICS}": xr.Dataset(
            {"deviation": ("band", np.asarray(statistics.deviations))},
            attrs={"lags": np.array(statistics.lags, np.int32)},
        )
    }
    for one in statistics.all:
        groups[f"/{STATISTICS}/{_name(one)}"] = _dataset(one)
    return groups


def read_statistics(tree: xr.DataTree) -> Statistics:
    """Return the statistics that a file holds."""
    group = tree.children[STATISTICS]
    deviations = group.dataset["deviation"].to_numpy()
    parts = {name: _statistic(name, one, len(deviations)) for name, one in (
        (name, child.dataset) for name, child in group.children.items()
    )}  # fmt: skip
    coverage = parts.pop(_RATIOS[Coverage])
    assert isinstance(coverage, Coverage)
    order = [*_NAMES.values(), *_RATIOS.values()]
    return Statistics(
        jnp.asarray(deviations),
        tuple(parts[name] for name in order if name in parts),
        coverage,
        tuple(int(lag) for lag in np.atleast_1d(group.attrs["lags"])),
    )


def _name(one: AbstractStatistic) -> str:
    kinds = _NAMES if isinstance(one, Histograms) else _RATIOS
    return kinds[type(one.functional if isinstance(one, Histograms) else one)]


def _dataset(one: AbstractStatistic) -> xr.Dataset:
    # Tenths of pixels take half the space.
    observed = (("block", "row", "part"), np.asarray(one.observed).round(1))
    if not isinstance(one, Histograms):
        return xr.Dataset({"observed": observed})
    found: dict[str, Any] = {
        "observed": observed,
        "low": ("row", np.asarray(one.bins.low)),
        "high": ("row", np.asarray(one.bins.high)),
        "scale": ("row", np.asarray(one.scale)),
    }
    if isinstance(one.functional, Increments):
        found["size"] = (("band", "lag"), np.asarray(one.functional.size))
    return xr.Dataset(found)


def _statistic(name: str, data: xr.Dataset, bands: int) -> AbstractStatistic:
    found = {key: jnp.asarray(data[key].to_numpy()) for key in data.data_vars}
    for kind, known in _RATIOS.items():
        if name == known:
            return kind(found["observed"])
    functionals: dict[str, AbstractFunctional] = {
        _NAMES[Values]: Values(),
        _NAMES[CrossBands]: CrossBands.of(bands),
    }
    if name == _NAMES[Increments]:
        functionals[name] = Increments(found["size"])
    observed = found["observed"]
    bins = Bins(found["low"], found["high"], observed.shape[-1])
    return Histograms(
        functional=functionals[name],
        bins=bins,
        scale=found["scale"],
        observed=observed,
    )
