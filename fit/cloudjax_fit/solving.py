"""The best end of a solver, from several starts."""

import functools as ft
from collections.abc import Iterator, Sequence
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .checkpoint import Checkpoint
from .objective import AbstractProblem
from .parameters import Parameter, unbounded_of
from .solver import Progress, Solution, Solver


def draw_starts(
    parameters: Sequence[Parameter], count: int, seed: int
) -> list[Float[Array, " parameters"]]:
    """Return the defaults first, then draws from the priors."""
    first = unbounded_of(parameters)
    rng = np.random.default_rng(seed)
    others = rng.standard_normal((count - 1, len(parameters)))
    return [first, *(jnp.asarray(z, first.dtype) for z in others)]


def solve(
    solver: Solver,
    problem: AbstractProblem,
    starts: Sequence[Float[Array, " parameters"]],
    checkpoint: Checkpoint,
) -> tuple[Solution, str]:
    """Solve from all starts, until the solver is told to stop.

    **Returns:** the best solution, interrupted if the last was, and how it ended in
    words.
    """
    solutions = [*_solutions(solver, problem, starts, checkpoint)]
    best, last = min(solutions, key=_merit), solutions[-1]
    status = best.message
    if last.interrupted and len(starts) > 1:
        status = f"start {len(solutions)} of {len(starts)}: {last.message}"
    return replace(best, interrupted=last.interrupted), status


def _solutions(
    solver: Solver, problem: AbstractProblem, starts: Sequence, checkpoint: Checkpoint
) -> Iterator[Solution]:
    """From one start after the other, until the solver is told to stop."""
    progress = checkpoint.read(lambda: solver.begin(starts[0]))
    begun = dict(enumerate(progress))

    def keep(i: int, at: Progress) -> None:
        begun[i] = at
        checkpoint.write(list(begun.values()))

    for i, z in enumerate(starts):
        at = begun.get(i) or solver.begin(z)
        solution = solver.go_on(problem, at, ft.partial(keep, i))
        yield solution
        if solution.interrupted:
            return


def _merit(solution: Solution) -> tuple[bool, float]:
    return not solution.converged, solution.loss
