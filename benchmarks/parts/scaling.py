"""How the cost of a march grows with the work, and falls with cores."""

import math
import os
from collections.abc import Callable

from peers import ours
from peers.problem import Problem

from .sizes import Context
from .text import table
from .workers import Worker, in_turns


NODES = 3


def run(context: Context) -> dict:
    sizes = context.sizes
    problem = Problem(
        sizes.scan_pixels[0], sizes.scan_voxels, steps=0, fraction=context.fraction
    )
    scans = {
        "pixels": sizes.scan_pixels,
        "steps": sizes.scan_steps,
        "layers": sizes.scan_layers,
        "bands": sizes.scan_bands,
    }
    usual = {name: values[0] for name, values in scans.items()}
    found = {}
    for name, values in scans.items():
        context.log(f"scaling: {name}")
        seconds = measure(problem, [usual | {name: value} for value in values], sizes)
        counts = [v**2 if name == "pixels" else v for v in values]
        found[name] = {
            "values": counts,
            "seconds": seconds,
            "power": _power(counts, seconds),
        }
    return {"scans": found, "cores": cores(problem, context)}


def measure(problem: Problem, cases: list[dict], sizes) -> list[float]:
    worker = Worker(load, problem, cases)
    names = [str(i) for i in range(len(cases))]
    for name in names:
        worker.run(name)
    runs = in_turns([(worker, name) for name in names], sizes.repeats)
    worker.close()
    return [min(found for _, found in results) for results in runs]


def load(problem: Problem, cases: list[dict]) -> dict[str, Callable]:
    """Seconds of the march of each case, by its number."""
    return {str(i): _march(problem, **case) for i, case in enumerate(cases)}


def _march(problem: Problem, pixels, steps, layers, bands) -> Callable[[], float]:
    some = Problem(pixels, problem.voxels, problem.steps, problem.fraction)
    marching = ours.disc(some, [(steps, NODES)], layers, bands)
    return lambda: sum(marching.run()["march"].values())


def _power(counts, seconds) -> float:
    """Of the count, that the cost grows with over the whole scan."""
    return math.log(seconds[-1] / seconds[0]) / math.log(counts[-1] / counts[0])


def cores(problem: Problem, context: Context) -> dict:
    """The same march on one core and on all."""
    if not hasattr(os, "sched_setaffinity"):
        return {}
    every = sorted(os.sched_getaffinity(0))
    context.log(f"scaling: 1 core and {len(every)}")
    sizes = context.sizes
    case = {"pixels": sizes.scan_pixels[-1], "steps": 24, "layers": 1, "bands": 1}
    workers = [Worker(load_on, some, problem, [case]) for some in (every[:1], every)]
    for worker in workers:
        worker.run("0")
    runs = in_turns([(worker, "0") for worker in workers], sizes.repeats)
    one, all_of_them = (min(found for _, found in results) for results in runs)
    for worker in workers:
        worker.close()
    return {"cores": len(every), "one_s": one, "all_s": all_of_them}


def load_on(allowed: list[int], problem: Problem, cases) -> dict[str, Callable]:
    """As `load`, on some cores only."""
    os.sched_setaffinity(0, allowed)
    return load(problem, cases)


def tables(found: dict) -> str:
    lines = [
        [
            name,
            " ".join(f"{v:g}" for v in scan["values"]),
            " ".join(f"{s:.2f}" for s in scan["seconds"]),
            f"{scan['power']:.2f}",
        ]
        for name, scan in found["scans"].items()
    ]
    head = ["cost against", "values", "s", "power"]
    parts = ["### Scaling of the march", "", table(head, lines), ""]
    if cores := found["cores"]:
        parts += [
            f"On {cores['cores']} cores {cores['all_s']:.2f} s, on one "
            f"{cores['one_s']:.2f} s: {cores['one_s'] / cores['all_s']:.2f} times "
            "faster.",
            "",
        ]
    return "\n".join(parts)
