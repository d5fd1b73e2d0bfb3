"""Levenberg-Marquardt on a problem, compiled once and run from any start."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import equinox as eqx
import jax
import lineax as lx
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float

from .objective import Problem, residuals


# Of a prior's standard deviation, and of a residual's: a step that changes less is no
# news beside the noise of either.
TOLERANCE = 1e-2


class LevenbergMarquardt(optx.AbstractGaussNewton):
    """Levenberg-Marquardt for residuals in float32.

    The trust region grows already where three quarters of the predicted decrease come
    true: rounding hides the last per cent that optimistix's own asks for, and damping
    that never relaxes creeps along valleys for hundreds of steps.
    """

    rtol: float
    atol: float
    verbose: Callable[..., None]
    norm: Callable = optx.max_norm
    descent: optx.DampedNewtonDescent = optx.DampedNewtonDescent(linear_solver=lx.QR())
    search: optx.ClassicalTrustRegion = optx.ClassicalTrustRegion(high_cutoff=0.75)


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
        z = jax.numpy.zeros(len(problem.parameters))
        self._solve = (
            eqx.filter_jit(self._least_squares).lower(z, problem, max_steps).compile()
        )
        self._max_steps = max_steps
        self.compile_seconds = time.perf_counter() - started

    def __call__(self, problem: Problem, z: Float[Array, " parameters"]) -> Solution:
        started = time.perf_counter()
        self._losses.clear()
        solution = self._solve(z, problem, self._max_steps)
        z = np.asarray(solution.value)
        jax.effects_barrier()
        loss = float(0.5 * (residuals(solution.value, problem) ** 2).sum())
        converged = bool(solution.result == optx.RESULTS.successful)
        message = self._in_words(converged)
        if not np.isfinite(loss):
            converged, message = False, "the residuals are not finite"
        return Solution(
            z, converged, message, (*self._losses, loss), time.perf_counter() - started
        )

    def _in_words(self, converged: bool) -> str:
        steps = len(self._losses)
        if converged:
            return f"converged in {steps} steps"
        if steps >= self._max_steps:
            return f"not converged in the {steps} steps allowed: allow more"
        return f"the solver broke down after {steps} steps: try another start"

    def _least_squares(self, z, problem, max_steps):
        solver = LevenbergMarquardt(TOLERANCE, TOLERANCE, self._verbose)
        return optx.least_squares(
            residuals, solver, z, args=problem, max_steps=max_steps, throw=False
        )

    def _verbose(self, **facts):
        jax.debug.callback(
            self._record, facts["num_steps"][1], facts["loss_this_step"][1],
            ordered=True,
        )  # fmt: skip

    def _record(self, step, loss):
        self._losses.append(float(loss))
        if self._on_step is not None:
            self._on_step(int(step), float(loss))
