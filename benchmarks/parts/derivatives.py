"""Derivatives of a fit's residuals beside the residuals themselves.

The problem is that of a fit of the embedded scene: 8192 rays, two layers, three bands,
textures sampled beforehand; 14 parameters, those of the shapes of both clouds.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp

from .sizes import Context
from .text import table
from .workers import Worker, in_turns, median_seconds


COUNT = 14
NAMES = {
    "residuals": "residuals, once",
    "jacfwd": "Jacobian, forward mode",
    "grad": "gradient of their squares, reverse mode",
}


def run(context: Context) -> dict:
    rays = context.sizes.fit_rays
    context.log(f"derivatives: {COUNT} parameters, {rays} rays")
    workers = [Worker(load, name, rays) for name in NAMES]
    compiled = [worker.run("compile")[1] for worker in workers]
    repeats = 3 * context.sizes.repeats
    runs = in_turns([(worker, "run") for worker in workers], repeats)
    seconds = [median_seconds(results) for results in runs]
    peaks = [worker.close() for worker in workers]
    return {
        "rays": rays,
        "parameters": COUNT,
        "entries": [
            {
                "name": NAMES[name],
                "seconds": s,
                "ratio": s / seconds[0],
                "peak_mb": peak,
                **facts,
            }
            for name, s, peak, facts in zip(
                NAMES, seconds, peaks, compiled, strict=True
            )
        ],
    }


def load(mode: str, rays: int) -> dict[str, Callable]:
    """One of the functions above, compiled apart from being run."""
    import time

    from cloudjax_fit.objective import residuals
    from cloudjax_fit.parameters import unbounded_of

    problem, parameters = make_problem(rays)

    def loss(z, problem):
        return 0.5 * (residuals(z, problem) ** 2).sum()

    function = {
        "residuals": residuals,
        "jacfwd": jax.jacfwd(residuals),
        "grad": jax.grad(loss),
    }[mode]
    z = unbounded_of(parameters)
    compiled = []

    def compile_it() -> dict[str, float]:
        started = time.perf_counter()
        compiled.append(jax.jit(function).lower(z, problem).compile())
        taken = time.perf_counter() - started
        jax.block_until_ready(compiled[0](z, problem))
        working = compiled[0].memory_analysis().temp_size_in_bytes
        return {"compile_seconds": taken, "working_mb": working / 1e6}

    def run_it() -> float:
        return float(jnp.sum(compiled[0](z, problem)))

    return {"compile": compile_it, "run": run_it}


def make_problem(rays: int):
    """The fit of the embedded scene with the parameters of the clouds' shapes."""

    from cloudjax_fit.embedded import embedded_target
    from cloudjax_fit.objective import pose
    from cloudjax_fit.scene_parameters import scene_parameters
    from cloudjax_scenes import SceneFromImagery

    target = embedded_target()
    made_of = SceneFromImagery(target.imagery)
    every = scene_parameters(made_of)
    shapes = [
        p
        for p in every
        if p.name.split(".")[0] in target.imagery.fractions
        and not p.name.endswith(("infrared_ratio", "_response"))
    ]
    assert len(shapes) == COUNT
    problem, _ = pose(target, made_of.build(), shapes, rays=rays, seed=0)
    return problem, shapes


def tables(found: dict) -> str:
    lines = [
        [
            e["name"],
            f"{1e3 * e['seconds']:.0f}",
            f"{e['ratio']:.2f}",
            f"{e['working_mb']:.0f}",
            f"{e['peak_mb']:.0f}",
            f"{e['compile_seconds']:.1f}",
        ]
        for e in found["entries"]
    ]
    title = f"### Derivatives by {COUNT} parameters, {found['rays']} rays"
    head = ["", "ms", "over once", "working MB", "peak MB", "compile s"]
    return "\n".join([title, "", table(head, lines), ""])
