"""How sure the fitted parameters are, and which of them the data do not determine.

The residuals are not independent: neighbouring bins of a cumulative histogram, bands,
and pixels of one cloud go together. Their covariance is taken from the image itself, by
resampling its blocks (block bootstrap; Künsch 1989, Ann. Statist. 17, 1217), for the
observed clouds and for the simulated ones, which are another draw of the same weather.
With it, the covariance of the parameters is the sandwich

    A Jᵀ C J A,    A = (Jᵀ J)⁻¹,

in which the prior takes part as residuals of unit variance.

The Jacobian is of a few draws of the clouds, and its own noise looks like knowledge: a
weight that changes nothing but which speck stands where has large derivatives, too. The
squares of that noise, found from how quarters of the draws differ, are taken out of
both products (docs/decisions.md).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .objective import QUARTERS, AbstractProblem, Problem
from .parameters import Parameter
from .solver import Solution
from .statistics import Statistics


RESAMPLES = 400
# A parameter, or a combination of some, is determined if the data halve its prior.
DETERMINED = 0.5
# Nearer to a bound than this share of the range, it is the bound that decides.
AT_BOUND = 0.01


@dataclass(frozen=True)
class Estimate:
    """An `Estimate` is a fitted parameter and how sure it is.

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
    problem: AbstractProblem,
    parameters: Sequence[Parameter],
    z_start: Float[Array, " parameters"],
    solution: Solution,
    quarters: Float[np.ndarray, "quarters residuals parameters"],
    *,
    seed: int,
) -> tuple[list[Estimate], list[str]]:
    """Return values with standard deviations, and in words what the data do not
    determine.

    **Arguments:** `parameters`: those of the problem; `quarters`: of the Jacobian of
    the solution, `Solver.quarters`.
    """
    covariance = _sandwich(problem, solution, quarters, seed)
    z_fit = jnp.asarray(solution.z)
    own = problem.parameters
    start = np.asarray(own.values(z_start), float)
    value = np.asarray(own.values(z_fit), float)
    slopes = np.diag(np.asarray(jax.jacfwd(own.scaled)(z_fit), float))
    # On each parameter's own scale, in standard deviations of its prior.
    spreads = np.array([p.spread for p in parameters])
    relative = covariance * np.outer(slopes / spreads, slopes / spreads)
    # No combination is known less well than by the priors alone.
    relative = _clipped(relative, most=1.0)
    deviations = np.sqrt(np.diag(relative))
    estimates = [
        _estimate(*row)
        for row in zip(parameters, value, start, deviations, strict=True)
    ]
    return estimates, _undetermined(parameters, relative)


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


def _sandwich(
    problem: AbstractProblem, solution: Solution, quarters, seed: int
) -> Float[np.ndarray, "parameters parameters"]:
    """A Jᵀ C J A, scene by scene: what one scene's weather is, no other knows.

    Residuals of places and of the priors are independent, of variance 1.
    """
    rest, bread, filling = solution.jacobian, 0.0, 0.0
    for scene, sums in problem.scenes(solution.sums):
        noise = _noise(scene, sums, seed)
        count = len(noise)
        own, rest = rest[:count], rest[count:]
        parts, quarters = quarters[:, :count], quarters[:, count:]
        bread = bread + _product(own, parts, np.eye(count))
        filling = filling + _product(own, parts, noise)
    priors = rest.T @ rest
    # The rows of the priors keep the sum regular, whatever the data say, unless
    # rounding has put a parameter onto its bound, where it moves nothing.
    found = np.linalg.pinv(_clipped(bread) + priors, hermitian=True)
    return found @ (_clipped(filling) + priors) @ found


def _product(jacobian, quarters, weight) -> Float[np.ndarray, "parameters parameters"]:
    """Jᵀ W J without the square of the noise of J, the sum of independent quarters."""
    off = quarters - quarters.mean(0)
    noise = np.einsum("qnp,nm,qml->pl", off, weight, off, optimize=True)
    return jacobian.T @ weight @ jacobian - QUARTERS / (QUARTERS - 1) * noise


def _clipped(matrix, most: float = np.inf) -> Float[np.ndarray, "n n"]:
    """The nearest symmetric matrix with eigenvalues from 0 to `most`."""
    values, vectors = np.linalg.eigh((matrix + matrix.T) / 2)
    return (vectors * np.clip(values, 0, most)) @ vectors.T


def _noise(
    problem: Problem, simulated, seed: int
) -> Float[np.ndarray, "residuals residuals"]:
    """Covariance of all residuals of a scene."""
    data = _bootstrap(problem.statistics, simulated, np.random.default_rng(seed))
    noise = np.eye(len(data) + len(problem.block_fraction))
    noise[: len(data), : len(data)] = data
    return noise


def _bootstrap(
    statistics: Statistics, simulated, rng
) -> Float[np.ndarray, "data data"]:
    """Covariance of simulated less observed numbers, blocks being drawn anew.

    One draw serves both sides: what the weather of a block is, they share, and what
    one draw of clouds differs from another they do not.
    """
    observed = [np.asarray(one.observed, float) for one in statistics.all]
    known = np.ones(len(observed[-1]), bool)
    for side in (observed, simulated):
        known &= side[-1][:, 0, 1] > 0
    blocks = int(known.sum())
    draws = rng.multinomial(blocks, np.full(blocks, 1 / blocks), size=RESAMPLES)
    differences = []
    for one, *sides in zip(statistics.all, simulated, observed, strict=True):
        of_draws = jax.vmap(one.numbers)
        told, seen = (
            np.asarray(of_draws(jnp.asarray(np.tensordot(draws, each[known], axes=1))))
            for each in sides
        )
        differences.append(told - seen)
    return np.cov(np.concatenate(differences, axis=1), rowvar=False)


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
