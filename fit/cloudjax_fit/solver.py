"""Levenberg-Marquardt on a problem, compiled once and run from any start."""

import functools as ft
import math
import time
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float

from .objective import (
    QUARTERS,
    AbstractProblem,
    residuals_and_sums,
    structure_of,
)


# Of a prior's standard deviation, and of a residual's: a step that changes less is no
# news beside the noise of either.
TOLERANCE = 1e-2
# Of the first step, of the order of the least curvatures of the twin's loss: an
# undamped one leads far off (docs/decisions.md).
FIRST_DAMPING = 100.0
# A fit has converged where this many steps gained less than this share of the loss:
# along the valleys of its parameters a solver creeps for as many steps again, for some
# hundredths of a per cent (docs/decisions.md).
CREEPING_STEPS = 5
CREEPING_GAIN = 1e-3


OnStep = Callable[[int, float], None]


@dataclass(frozen=True, eq=False)
class Progress:
    """`Progress` is how far a solver has come from one start, and all that it needs to
    go on.

    **Fields:**

    - `z`: the parameters on the solver's scale.
    - `state`: arrays of the solver, a pytree.
    - `losses`: of all points that were tried.
    - `loss`: of the best of them; `ends`: the solver sees a minimum there; `sound`: it
      still works.
    """

    z: Float[Array, " parameters"]
    state: Any
    losses: tuple[float, ...] = ()
    loss: float = math.inf
    ends: bool = False
    sound: bool = True

    @property
    def creeps(self) -> bool:
        """Whether the last steps gained next to nothing."""
        return creeps(self.losses)

    @property
    def converged(self) -> bool:
        """Whether the solver has found a minimum."""
        return (self.creeps or self.ends) and self.sound


OnProgress = Callable[[Progress], None]


@dataclass(frozen=True, eq=False)
class Solution:
    """A `Solution` is where a solver stopped.

    **Fields:**

    - `z`: the parameters on the solver's scale.
    - `converged`, `message`: whether it stopped at a minimum, and what it says.
    - `jacobian`: of the residuals there.
    - `sums`: that the simulated statistics are found from, block by block.
    - `history`: half the sum of squared residuals after each step.
    - `seconds`: of wall time.
    - `interrupted`: whether it was told to stop.
    """

    z: Float[np.ndarray, " parameters"]
    converged: bool
    message: str
    jacobian: Float[np.ndarray, "residuals parameters"]
    sums: Any
    history: tuple[float, ...]
    seconds: float
    interrupted: bool = False

    @property
    def loss(self) -> float:
        """Give half the sum of squared residuals in the end."""
        return self.history[-1]


class Solver:
    """A `Solver` is a Levenberg-Marquardt solver, compiled for problems of one
    structure.

    One step is compiled, and repeated from the host: a function that calls back to the
    host could not be kept by JAX's compilation cache. The step of the latest structure
    is kept for the next solver, for scenes of one structure come one after the other.

    **Arguments:**

    - `on_step`: called with the number of each step and its loss.
    - `stop`: asked after each step whether to leave off.
    """

    def __init__(
        self,
        problem: AbstractProblem,
        *,
        max_steps: int = 150,
        on_step: OnStep | None = None,
        stop: Callable[[], bool] = lambda: False,
    ):
        self._max_steps, self._on_step, self._stop = max_steps, on_step, stop
        started = time.perf_counter()
        self._start, self._static, self._compiled = _latest_step(problem)
        self.compile_seconds = time.perf_counter() - started

    def begin(self, z: Float[Array, " parameters"]) -> Progress:
        """Return the progress of a start from which no step has been made."""
        return Progress(z, eqx.tree_at(lambda s: s.y_eval, self._start, z))

    def __call__(
        self, problem: AbstractProblem, z: Float[Array, " parameters"]
    ) -> Solution:
        """Solve a problem from a start."""
        return self.go_on(problem, self.begin(z))

    def go_on(
        self,
        problem: AbstractProblem,
        begun: Progress,
        on_progress: OnProgress = lambda progress: None,
    ) -> Solution:
        """Go on until the solver ends, or is told to stop.

        **Arguments:** `on_progress`: called after each step with what another call, in
        another process too, can go on from.
        """
        started = time.perf_counter()
        at = begun
        while not self._is_over(at):
            at = self._advance(at, problem)
            if self._on_step is not None:
                self._on_step(len(at.losses) - 1, at.losses[-1])
            on_progress(at)
            # After a step: before the first there is nothing to tell.
            if self._stop():
                break
        ended: Any = eqx.combine(at.state, self._static)
        finite = bool(np.isfinite(at.loss))
        return Solution(
            z=np.asarray(at.z),
            converged=at.converged and finite,
            message=self._in_words(at) if finite else "the residuals are not finite",
            # That of the last accepted point is kept: none has to be compiled.
            jacobian=np.asarray(_as_matrix(ended.f_info.jac), float),
            sums=jax.tree.map(lambda sums: np.asarray(sums, float), ended.aux),
            history=(*at.losses, at.loss),
            seconds=time.perf_counter() - started,
            interrupted=not self._is_over(at),
        )

    def quarters(
        self, problem: AbstractProblem, z: Float[np.ndarray, " parameters"]
    ) -> Float[np.ndarray, "quarters residuals parameters"]:
        """Return the Jacobian of the residuals by quarters of the draws of the clouds;
        those of the data, but not those of the priors, add up to the whole one.
        """
        start = self.begin(jnp.asarray(z))
        found = []
        for number in range(QUARTERS):
            # The first step begins with the Jacobian where it starts.
            _, state, _ = self._compiled(start.z, start.state, problem.quarter(number))
            ended: Any = eqx.combine(state, self._static)
            found.append(np.asarray(_as_matrix(ended.f_info.jac), float))
        return np.stack(found)

    def _advance(self, at: Progress, problem: AbstractProblem) -> Progress:
        z, state, facts = self._compiled(at.z, at.state, problem)
        facts = jax.device_get(facts)
        return Progress(
            z,
            state,
            (*at.losses, float(facts.tried_loss)),
            float(facts.loss),
            bool(facts.ends),
            bool(facts.sound),
        )

    def _is_over(self, at: Progress) -> bool:
        ends = at.creeps or at.ends or not at.sound
        return ends or len(at.losses) >= self._max_steps

    def _in_words(self, at: Progress) -> str:
        steps = len(at.losses)
        if at.converged and at.creeps:
            little = f"{CREEPING_STEPS} gained less than {CREEPING_GAIN:.1%}"
            return f"converged in {steps} steps: the last {little}"
        if at.converged:
            return f"converged in {steps} steps"
        if not self._is_over(at):
            return f"interrupted after {steps} steps: this is the best so far"
        if steps >= self._max_steps:
            return f"not converged in the {steps} steps allowed: allow more"
        return f"the solver broke down after {steps} steps: try another start"


def creeps(losses: Sequence[float]) -> bool:
    """Tell whether the last `CREEPING_STEPS` steps gained less than `CREEPING_GAIN`.

    A step that makes the loss worse by more than that is not counted: it was too long,
    and says nothing of what shorter ones may gain.

    **Arguments:** `losses`: of all points that were tried, the start first.
    """
    best, bests = math.inf, []
    for loss in losses:
        if loss < (1 + CREEPING_GAIN) * best:
            best = min(best, loss)
            bests.append(best)
    if len(bests) <= CREEPING_STEPS:
        return False
    return bests[-1 - CREEPING_STEPS] - best < CREEPING_GAIN * best


_as_matrix = eqx.filter_jit(lambda operator: operator.as_matrix())


class _Step(NamedTuple):
    """A compiled step, and the two halves of the state that it begins with."""

    start: Any
    static: Any
    compiled: Any


def _compiled_step(problem: AbstractProblem) -> _Step:
    z = jnp.zeros(len(problem.parameters))
    rows, sums = eqx.filter_eval_shape(residuals_and_sums, z, problem)
    state = _levenberg_marquardt().init(
        residuals_and_sums, z, problem, {}, rows, sums, frozenset()
    )
    state = eqx.tree_at(
        lambda s: s.search_state.step_size, state, jnp.asarray(1 / FIRST_DAMPING)
    )
    start, static = eqx.partition(state, eqx.is_array)
    step: Any = eqx.filter_jit(ft.partial(_step, static))
    return _Step(start, static, step.lower(z, start, problem).compile())


# By structure; one, for it holds hundreds of megabytes.
_latest: dict[Hashable, _Step] = {}


def forget_compiled() -> None:
    """Forget the compiled step that is kept."""
    _latest.clear()


def _latest_step(problem: AbstractProblem) -> _Step:
    """The compiled step for problems of this structure, the latest or a new one."""
    structure = structure_of(problem)
    if structure not in _latest:
        _latest.clear()
        _latest[structure] = _compiled_step(problem)
    return _latest[structure]


def _step(static, z, state, problem: AbstractProblem):
    told: dict[str, Any] = {}
    solver = _levenberg_marquardt(lambda **facts: told.update(facts))
    state = eqx.combine(state, static)
    found, state, _ = solver.step(
        residuals_and_sums, z, problem, {}, state, frozenset()
    )
    ends, result = solver.terminate(
        residuals_and_sums, found, problem, {}, state, frozenset()
    )
    facts = _Facts(
        tried_loss=told["loss_this_step"][1],
        loss=0.5 * (state.f_info.residual**2).sum(),
        ends=ends,
        sound=(result == optx.RESULTS.successful) & jnp.isfinite(z).all(),
    )
    return found, eqx.filter(state, eqx.is_array), facts


class _Facts(NamedTuple):
    """What the host must know of a step.

    **Fields:** the loss of the point that was tried, and of the best one since the
    start; whether the solver ends here; whether it still works.
    """

    tried_loss: Array
    loss: Array
    ends: Array
    sound: Array


def _levenberg_marquardt(
    verbose: Callable[..., None] | bool = False,
) -> optx.LevenbergMarquardt:
    """Levenberg-Marquardt for residuals in float32.

    The trust region grows already where three quarters of the predicted decrease come
    true: rounding hides the last per cent that optimistix's own asks for, and damping
    that never relaxes creeps along valleys for hundreds of steps.
    """
    solver = optx.LevenbergMarquardt(TOLERANCE, TOLERANCE, verbose=verbose)
    relaxed = optx.ClassicalTrustRegion(high_cutoff=0.75)
    return eqx.tree_at(lambda s: s.search, solver, relaxed)
