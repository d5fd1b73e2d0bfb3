"""Levenberg-Marquardt on a problem, compiled once and run from any start."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float

from .objective import Problem, residuals


# Of a prior's standard deviation, and of a residual's: a step that changes less is no
# news beside the noise of either.
TOLERANCE = 1e-2


OnStep = Callable[[int, float], None]


@dataclass(frozen=True, eq=False)
class Solution:
    """Where a solver stopped.

    **Fields:**

    - `z`: the parameters on the solver's scale.
    - `converged`, `message`: whether it stopped at a minimum, and what it says.
    - `history`: half the sum of squared residuals after each step.
    - `seconds`: of wall time.
    """

    z: Float[np.ndarray, " parameters"]
    converged: bool
    message: str
    history: tuple[float, ...]
    seconds: float

    @property
    def loss(self) -> float:
        return self.history[-1]


class Solver:
    """A compiled Levenberg-Marquardt solver for problems of one structure.

    **Arguments:** `on_step` is called on the host with the number of each step and its
    loss.
    """

    def __init__(
        self, problem: Problem, *, max_steps: int = 150, on_step: OnStep | None = None
    ):
        self._losses: list[float] = []
        self._on_step = on_step
        started = time.perf_counter()
        z = jnp.zeros(len(problem.parameters))
        self._max_steps = max_steps
        compiled: Any = eqx.filter_jit(self._least_squares)
        self._solve = compiled.lower(z, problem).compile()
        self.compile_seconds = time.perf_counter() - started

    def __call__(self, problem: Problem, z: Float[Array, " parameters"]) -> Solution:
        started = time.perf_counter()
        self._losses.clear()
        found, successful, loss = jax.device_get(self._solve(z, problem))
        jax.effects_barrier()
        converged, loss = bool(successful), float(loss)
        message = self._in_words(converged)
        if not np.isfinite(loss):
            converged, message = False, "the residuals are not finite"
        seconds = time.perf_counter() - started
        return Solution(found, converged, message, (*self._losses, loss), seconds)

    def _in_words(self, converged: bool) -> str:
        steps = len(self._losses)
        if converged:
            return f"converged in {steps} steps"
        if steps >= self._max_steps:
            return f"not converged in the {steps} steps allowed: allow more"
        return f"the solver broke down after {steps} steps: try another start"

    def _least_squares(self, z, problem):
        solver = _levenberg_marquardt(self._verbose)
        solution = optx.least_squares(
            residuals,
            solver,
            z,
            args=problem,
            max_steps=self._max_steps,
            throw=False,
        )
        loss = 0.5 * (residuals(solution.value, problem) ** 2).sum()
        return solution.value, solution.result == optx.RESULTS.successful, loss

    def _verbose(self, **facts):
        jax.debug.callback(
            self._record, facts["num_steps"][1], facts["loss_this_step"][1],
            ordered=True,
        )  # fmt: skip

    def _record(self, step, loss):
        self._losses.append(float(loss))
        if self._on_step is not None:
            self._on_step(int(step), float(loss))


def _levenberg_marquardt(verbose: Callable[..., None]) -> optx.LevenbergMarquardt:
    """Levenberg-Marquardt for residuals in float32.

    The trust region grows already where three quarters of the predicted decrease come
    true: rounding hides the last per cent that optimistix's own asks for, and damping
    that never relaxes creeps along valleys for hundreds of steps.
    """
    solver = optx.LevenbergMarquardt(TOLERANCE, TOLERANCE, verbose=verbose)
    relaxed = optx.ClassicalTrustRegion(high_cutoff=0.75)
    return eqx.tree_at(lambda s: s.search, solver, relaxed)
