"""The mesoscale scene of 2019-10-27: 500 x 500 pixels, two layers, three bands.

Peers overlay two marches, in JAX and in numba. They and cloudjax differ in more than
how they march (slabs, echoes between layers, emission along the ray): the errors of
each are against its own converged truth, over the deviation of that truth, and those of
the worst band.
"""

import pickle
import statistics
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from peers import ours
from scipy.stats import wasserstein_distance

from .sizes import Context
from .text import table
from .workers import Worker, in_turns, load_peer, median_seconds


PEERS = {
    "brute_jax": ("JAX, straightforward", "layered_jax"),
    "brute_numba": ("numba", "layered_numba"),
}


def run(context: Context) -> dict:
    from peers.demo import Demo

    sizes, demo = context.sizes, Demo(context.sizes.mesoscale_voxels)
    pixels = np.sort(
        np.random.default_rng(0).permutation(demo.count)[: sizes.truth_pixels // 2]
    )
    peers = [name for name in PEERS if name in context.peers]
    context.log("mesoscale: truths")
    truths = make_truths(demo, pixels, sizes)
    context.log(f"mesoscale: {', '.join(peers)} and cloudjax")
    with tempfile.TemporaryDirectory() as folder:
        file = _write(demo.picture(demo.rays(), sizes.mesoscale_steps), folder)
        workers = [Worker(load_peer, PEERS[name][1], file) for name in peers]
        workers.append(Worker(load_ours, demo.voxels, sizes.mesoscale_presets))
        first = [worker.run("render") for worker in workers]
        runs = in_turns([(worker, "render") for worker in workers], sizes.repeats)
        peaks = [worker.close() for worker in workers]
    entries = []
    for name, (cold, image), results, peak in zip(
        peers, first, runs, peaks, strict=False
    ):
        warm = median_seconds(results)
        entry = {"name": PEERS[name][0], "seconds": warm, "everything_seconds": warm}
        entry |= {"peak_mb": peak, "compile_seconds": cold - warm}
        entries.append(entry | errors(image[:, pixels], truths["peers"]))
    found, passes = first[-1][1], [result for _, result in runs[-1]]
    view = statistics.median(sum(p["view"].values()) for p in passes)
    for name, image in found["images"].items():
        march = statistics.median(p["march"][name] for p in passes)
        entry = {"name": name, "seconds": march, "everything_seconds": march + view}
        entry |= {"peak_mb": peaks[-1], "compile_seconds": found["compile"][name]}
        entries.append(entry | errors(image[:, pixels], truths["cloudjax"]))
    return {"voxels": demo.voxels, "entries": entries}


def make_truths(demo, pixels, sizes) -> dict[str, np.ndarray]:
    """Means of many hard rays by either, [bands pixels]."""
    from peers.hard import hard_rays

    parts, steps = sizes.truth_parts, sizes.truth_steps
    rays = demo.sub_rays(pixels, parts)
    with tempfile.TemporaryDirectory() as folder:
        file = _write(demo.picture(rays, steps), folder)
        worker = Worker(load_peer, "layered_jax", file)
        _, peers = worker.run("render")
        worker.close()
    own = hard_rays(demo.scene(steps, 1), rays, demo.sun)
    return {
        name: seen.reshape(len(seen), len(pixels), parts**2).mean(-1)
        for name, seen in (("peers", peers), ("cloudjax", own))
    }


def load_ours(voxels: int, presets) -> dict[str, Callable]:
    from peers.demo import Demo

    demo = Demo(voxels)
    scenes = {ours.name_of(p): demo.scene(*p) for p in presets}
    return {"render": ours.Marching(demo.sight(), scenes).run}


def _write(picture, folder: str) -> Path:
    file = Path(folder) / "picture.pickle"
    file.write_bytes(pickle.dumps(picture))
    return file


def errors(seen: np.ndarray, truth: np.ndarray) -> dict[str, float]:
    spread = truth.std(1)
    bias = (seen.mean(1) - truth.mean(1)) / spread
    w1 = [wasserstein_distance(a, b) for a, b in zip(seen, truth, strict=True)]
    return {
        "bias": float(bias[np.abs(bias).argmax()]),
        "rmse": float((np.sqrt(((seen - truth) ** 2).mean(1)) / spread).max()),
        "w1": float((np.array(w1) / spread).max()),
    }


def tables(found: dict) -> str:
    times = ["march s", "all s", "compile s", "peak MB"]
    head = ["", *times, "bias/std", "RMSE/std", "W1/std"]
    lines = [
        [
            e["name"],
            f"{e['seconds']:.2f}",
            f"{e['everything_seconds']:.2f}",
            f"{e['compile_seconds']:.1f}",
            f"{e['peak_mb']:.0f}",
            f"{e['bias']:+.3f}",
            f"{e['rmse']:.3f}",
            f"{e['w1']:.3f}",
        ]
        for e in found["entries"]
    ]
    title = f"### Mesoscale scene, 500², {found['voxels']}³, two layers, three bands"
    return "\n".join([title, "", table(head, lines), ""])
