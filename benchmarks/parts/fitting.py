"""The fit of the embedded scene beside scipy's with finite differences.

Both start at the defaults, stop at the same tolerance and call the same compiled
residuals of the same rays; textures are sampled beforehand for both.
"""

from collections.abc import Callable

import jax
import numpy as np
from scipy.optimize import least_squares

from .sizes import Context
from .text import table
from .workers import Worker


# Of a parameter, on its prior's scale: residuals in float32 hide smaller changes.
DIFFERENCE = 1e-3


def run(context: Context) -> dict:
    sizes = context.sizes
    entries = []
    for name, make in (("cloudjax", load_ours), ("scipy", load_scipy)):
        context.log(f"fitting: {name}")
        worker = Worker(make, sizes.fit_rays, sizes.fit_evaluations)
        compile_seconds, _ = worker.run("compile")
        seconds, facts = worker.run("fit")
        entry = {"name": name, "seconds": seconds, "peak_mb": worker.close()}
        entries.append(entry | {"compile_seconds": compile_seconds, **facts})
    return {
        "rays": sizes.fit_rays,
        "entries": entries,
        "ratio": entries[1]["seconds"] / entries[0]["seconds"],
    }


def _pose(rays: int):

    from cloudjax_fit.embedded import embedded_target
    from cloudjax_fit.objective import pose
    from cloudjax_fit.parameters import unbounded_of
    from cloudjax_fit.scene_parameters import scene_parameters
    from cloudjax_scenes import SceneFromImagery

    target = embedded_target()
    made_of = SceneFromImagery(target.imagery)
    parameters = [p for p in scene_parameters(made_of) if p.free]
    problem, _ = pose(target, made_of.build(), parameters, rays=rays, seed=0)
    return problem, unbounded_of(parameters)


def load_ours(rays: int, _: int) -> dict[str, Callable]:
    from cloudjax_fit.solver import Solver

    problem, z = _pose(rays)
    solvers = []

    def fit() -> dict:
        found = solvers[0](problem, z)
        return {
            "loss": found.loss,
            "start_loss": found.history[0],
            "ended": found.message,
            "evaluations": None,
            "parameters": len(z),
        }

    return {"compile": lambda: solvers.append(Solver(problem)), "fit": fit}


class _Enough(Exception):
    pass


def load_scipy(rays: int, most: int) -> dict[str, Callable]:
    from cloudjax_fit.objective import residuals
    from cloudjax_fit.solver import TOLERANCE

    problem, z = _pose(rays)
    compiled = jax.jit(residuals)
    losses: list[float] = []

    def one(x) -> np.ndarray:
        found = np.asarray(compiled((x - 1).astype(np.float32), problem), np.float64)
        losses.append(0.5 * float(found @ found))
        if len(losses) >= most:
            raise _Enough
        return found

    def fit() -> dict:
        losses.clear()
        # Counted from 1, because scipy's steps are relative.
        start = np.asarray(z, np.float64) + 1
        tolerance = {"ftol": TOLERANCE, "xtol": TOLERANCE, "gtol": None}
        try:
            found = least_squares(one, start, diff_step=DIFFERENCE, **tolerance)
            ended = f"converged: {found.message}" if found.success else found.message
        except _Enough:
            ended = f"stopped after {most} evaluations"
        return {
            "loss": min(losses),
            "start_loss": losses[0],
            "ended": ended,
            "evaluations": len(losses),
            "parameters": len(z),
        }

    return {"compile": lambda: jax.block_until_ready(compiled(z, problem)), "fit": fit}


def tables(found: dict) -> str:
    lines = [
        [
            e["name"],
            f"{e['seconds']:.1f}",
            f"{e['start_loss']:.0f}",
            f"{e['loss']:.1f}",
            e["evaluations"] or "",
            f"{e['compile_seconds']:.1f}",
            f"{e['peak_mb']:.0f}",
            e["ended"],
        ]
        for e in found["entries"]
    ]
    entry = found["entries"][0]
    title = (
        f"### Fit of the embedded scene, {entry['parameters']} parameters, "
        f"{found['rays']} rays"
    )
    head = ["", "s", "loss before", "after", "evaluations", "compile s", "peak MB", ""]
    least = "at least " if "stopped" in found["entries"][1]["ended"] else ""
    note = f"{least}{found['ratio']:.1f} times faster."
    return "\n".join([title, "", table(head, lines), "", note, ""])
