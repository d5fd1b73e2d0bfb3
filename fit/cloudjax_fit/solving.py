"""A problem is solved from several starts, and how sure the solution is follows."""

import functools as ft
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .checkpoint import Checkpoint
from .fit_settings import FitSettings
from .objective import AbstractProblem
from .parameters import Parameter, unbounded_of
from .phases import Phases
from .solver import OnStep, Progress, Solution, Solver
from .uncertainty import Estimate, estimate


def draw_starts(
    parameters: Sequence[Parameter], count: int, seed: int
) -> list[Float[Array, " parameters"]]:
    """Return the defaults first, then draws from the priors."""
    first = unbounded_of(parameters)
    rng = np.random.default_rng(seed)
    others = rng.standard_normal((count - 1, len(parameters)))
    return [first, *(jnp.asarray(z, first.dtype) for z in others)]


def solve_and_estimate(
    problem: AbstractProblem,
    parameters: Sequence[Parameter],
    settings: FitSettings,
    phases: Phases,
    on_step: OnStep | None,
    stop: Callable[[], bool],
    checkpoint: Checkpoint | None,
) -> tuple[Solution, str, list[Estimate], list[str]]:
    """Solve a problem, and say how sure its parameters are.

    **Arguments:** `parameters`: those of the problem; the others as of
    `cloudjax_fit.fit`.

    **Returns:** the best solution, how it ended in words, and what `estimate` returns.
    """
    solver = Solver(problem, max_steps=settings.max_steps, on_step=on_step, stop=stop)
    phases.lap("compile")
    starts = draw_starts(parameters, settings.starts, settings.seed)
    best, status = solve(solver, problem, starts, checkpoint or Checkpoint())
    phases.lap("solve")
    quarters = solver.quarters(problem, best.z)
    found = estimate(problem, parameters, starts[0], best, quarters, seed=settings.seed)
    phases.lap("uncertainty")
    return best, status, *found


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
