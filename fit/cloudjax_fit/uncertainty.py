"""How sure the fitted parameters are, and which of them the data do not determine.

The residuals are not independent: neighbouring bins of a cumulative histogram, bands,
and pixels of one cloud go together. Their covariance is taken from the image itself, by
resampling its blocks (block bootstrap; Künsch 1989, Ann. Statist. 17, 1217), for the
observed clouds and for the simulated ones, which are another draw of the same weather.
With it, the covariance of the parameters is the sandwich

    A Jᵀ C J A,    A = (Jᵀ J)⁻¹,

in which the prior takes part as residuals of unit variance.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .objective import COVERAGE_SCALE, SCALE, Problem, simulate
from .parameters import Parameter, values_of
from .solver import Solution
from .targets import Target


RESAMPLES = 400
# A parameter, or a combination of some, is determined if the data halve its prior.
DETERMINED = 0.5
# Nearer to a bound than this share of the range, it is the bound that decides.
AT_BOUND = 0.01


@dataclass(frozen=True)
class Estimate:
    """A fitted parameter.

    **Fields:**

    - `value`, `start`, `std`: after the fit, before, and its standard deviation.
    - `determined`: the data more than halve the prior, away from the bounds.
    - `at_bound`: within 1 % of a bound.
    """

    parameter: Parameter
    value: float
    start: float
    std: float
    determined: bool
    at_bound: bool


def estimate(
    problem: Problem,
    target: Target,
    z_start: Float[Array, " parameters"],
    solution: Solution,
    *,
    seed: int,
) -> tuple[list[Estimate], list[str]]:
    """Values with standard deviations, and in words what the data do not determine."""
    z_fit = jnp.asarray(solution.z)
    noise = _noise(problem, target, z_fit, seed)
    covariance = _sandwich(solution.jacobian, noise)
    start = np.asarray(values_of(problem.parameters, z_start), float)
    value = np.asarray(values_of(problem.parameters, z_fit), float)
    slopes = np.asarray(
        [
            jax.grad(lambda z, p=p: p.scaled(p.value(z)))(z_fit[i])
            for i, p in enumerate(problem.parameters)
        ],
        float,
    )
    # On each parameter's own scale, in standard deviations of its prior.
    spreads = np.array([p.spread for p in problem.parameters])
    relative = covariance * np.outer(slopes / spreads, slopes / spreads)
    deviations = np.sqrt(np.diag(relative))
    estimates = [
        _estimate(*row)
        for row in zip(problem.parameters, value, start, deviations, strict=True)
    ]
    return estimates, _undetermined(problem.parameters, relative)


def _estimate(parameter: Parameter, value, start, deviation) -> Estimate:
    span = parameter.scaled(parameter.upper) - parameter.scaled(parameter.lower)
    gaps = [
        abs(parameter.scaled(value) - parameter.scaled(end))
        for end in (parameter.lower, parameter.upper)
    ]
    at_bound = bool(min(gaps) < AT_BOUND * span)
    std = deviation * parameter.spread * (value if parameter.log else 1.0)
    return Estimate(
        parameter,
        float(value),
        float(start),
        float(std),
        determined=bool(deviation < DETERMINED) and not at_bound,
        at_bound=at_bound,
    )


def _sandwich(jacobian, noise) -> Float[np.ndarray, "parameters parameters"]:
    # The rows of the priors keep JᵀJ regular, whatever the data say.
    bread = np.linalg.inv(jacobian.T @ jacobian)
    return bread @ (jacobian.T @ noise @ jacobian) @ bread


def _noise(problem, target, z, seed) -> Float[np.ndarray, "residuals residuals"]:
    """Covariance of all residuals; those of the priors are independent and 1."""
    observed = np.concatenate(
        [_per_block(target.statistics[n].block_counts) for n in problem.scene.bands]
    )
    rng = np.random.default_rng(seed)
    data = _bootstrap(observed, target.block_cloud, target.block_valid, rng)
    data = data + _bootstrap(*_simulated_blocks(problem, target, z), rng)
    blocks = len(problem.block_fraction)
    size = len(data) + blocks + len(problem.parameters)
    noise = np.eye(size)
    noise[: len(data), : len(data)] = data
    return noise


def _per_block(counts) -> Float[np.ndarray, "bins blocks"]:
    return np.asarray(counts, float).T


def _simulated_blocks(problem: Problem, target: Target, z):
    """Histograms and cloud counts of the simulation, block by block."""
    seen, weights = eqx.filter_jit(simulate)(problem, values_of(problem.parameters, z))
    block, weights = np.asarray(problem.block_of_ray), np.asarray(weights, float)
    count = len(problem.block_fraction)
    rows = []
    for number, radiance in zip(problem.scene.bands, np.asarray(seen), strict=True):
        band = target.statistics[number]
        bins = np.linspace(band.low, band.high, band.block_counts.shape[1] + 1)
        inside = np.clip(radiance, band.low, band.high)
        edges = [np.arange(count + 1) - 0.5, bins]
        rows.append(np.histogram2d(block, inside, bins=edges, weights=weights)[0].T)
    cloud = np.bincount(block, weights, minlength=count)
    return np.concatenate(rows), cloud, np.asarray(problem.block_rays, float)


def _bootstrap(counts, cloud, valid, rng) -> Float[np.ndarray, "data data"]:
    """Covariance of the residuals of all bands and of the coverage."""
    known = valid > 0
    counts, cloud, valid = counts[:, known], cloud[known], valid[known]
    blocks = counts.shape[1]
    draws = rng.multinomial(blocks, np.full(blocks, 1 / blocks), size=RESAMPLES)
    resampled = draws @ counts.T
    total = np.maximum(draws @ cloud, 1e-9)
    coverage = total / np.maximum(draws @ valid, 1e-9)
    bands = round(counts.sum() / max(cloud.sum(), 1e-9))
    shape = resampled.reshape(RESAMPLES, bands, -1).cumsum(-1) / total[:, None, None]
    rows = np.concatenate(
        [SCALE * shape.reshape(RESAMPLES, -1), COVERAGE_SCALE * coverage[:, None]], 1
    )
    return np.cov(rows, rowvar=False)


def _undetermined(parameters: Sequence[Parameter], relative) -> list[str]:
    """Combinations whose variance the data do not even quarter, in words."""
    variances, directions = np.linalg.eigh(relative)
    sentences = []
    for variance, direction in zip(variances[::-1], directions.T[::-1], strict=True):
        if variance < DETERMINED**2:
            break
        direction = direction * np.sign(direction[np.argmax(np.abs(direction))])
        largest = np.argsort(-np.abs(direction))
        terms = [
            f"{direction[i]:+.2f} {parameters[i].name}"
            for i in largest
            if abs(direction[i]) > 0.3
        ]
        sentences.append(
            f"{' '.join(terms)} (in units of the priors) is known to "
            f"{np.sqrt(variance):.2g} of its prior alone"
        )
    return sentences
