"""The four rows of the paper's Table 3: a full disc through one shell of cloud.

The truth is the mean of many hard rays per pixel in many steps, for a random choice of
pixels. Clouds have as many octaves as the row's voxels hold: one more for 256 per axis.
"""

import dataclasses
import pickle
import statistics
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from peers import brute_jax, ours
from peers.hard import hard_rays
from peers.problem import SUN, Problem
from scipy.stats import wasserstein_distance

from .sizes import Context, Sizes
from .text import table
from .workers import Worker, in_turns, load_peer, median_seconds


PEERS = {
    "brute_jax": "JAX, straightforward",
    "brute_numba": "numba",
    "brute_drjit": "Dr.Jit",
}
# Two pictures are of the same algorithm if pixels differ by so much in the mean, which
# is what float32 positions and a threshold leave: a step more or less in cloud.
SAME = 1e-3
# Of opaque cloud from cloudjax's hard limit, which looks at slopes at each third step.
SAME_AS_HARD = 3e-3
HARD_RAYS, HARD_STEPS = 4096, 100


@dataclass(frozen=True)
class Row:
    """Pixels per side, voxels per axis, steps; the paper's milliseconds on its GPU."""

    pixels: int
    voxels: int
    steps: int
    gtx1650_ms: float

    @property
    def title(self) -> str:
        return f"{self.pixels}², {self.voxels}³, {self.steps} steps"


ROWS = (
    Row(2000, 256, 25, 718),
    Row(1000, 256, 25, 195),
    Row(2000, 128, 25, 590),
    Row(2000, 256, 15, 458),
)


def run(context: Context) -> dict:
    """Measure all rows."""
    sizes, peers, log = context.sizes, context.peers, context.log
    rows = [Row(*sizes.disc, gtx1650_ms=np.nan)] if sizes.disc else ROWS
    apart = hard_limit_apart(context)
    log(f"table3: peers and the hard limit of cloudjax are {apart:.1e} apart")
    found = []
    for row in rows:
        problem = Problem(row.pixels, row.voxels, row.steps, context.fraction)
        log(f"table3: {row.title}: truth")
        pixels = choose_pixels(problem, sizes.truth_pixels)
        truth = make_truth(problem, pixels, sizes)
        log(f"table3: {row.title}: {', '.join(peers)} and cloudjax")
        entries = measure(problem, peers, sizes)
        for entry in entries:
            entry |= errors(entry.pop("image")[pixels], truth)
            log(f"table3: {entry['name']}: {entry['seconds']:.2f} s")
        judge(entries)
        found.append(dataclasses.asdict(row) | {"title": row.title, "entries": entries})
    return {"rows": found, "hard_limit_apart": apart}


def hard_limit_apart(context: Context) -> float:
    """Mean difference of a peer from cloudjax's hard limit, for opaque cloud.

    There both see the same first surface: elsewhere cloudjax takes the normal where
    the light is stopped, which is deeper in.
    """
    problem = Problem(500, 128, HARD_STEPS, context.fraction, extinction_per_m=1.0)
    pixels = choose_pixels(problem, HARD_RAYS)
    rays = problem.grid().rays(pixels)
    peer = brute_jax.prepare(problem.work(rays))()
    (own,) = hard_rays(problem.scene(problem.steps, nodes=1), rays, SUN)
    apart = float(np.abs(own - peer).mean())
    if apart > SAME_AS_HARD:
        raise RuntimeError(
            f"The peers and the hard limit of cloudjax differ by {apart:.1e} in the "
            "mean: they do not render the same clouds."
        )
    return apart


def choose_pixels(problem: Problem, count: int) -> np.ndarray:
    """Of those that see the Earth."""
    _, hit = problem.grid().rays().ground()
    every = np.flatnonzero(hit)
    return np.random.default_rng(0).permutation(every)[:count]


def make_truth(problem: Problem, pixels: np.ndarray, sizes: Sizes) -> np.ndarray:
    parts = sizes.truth_parts
    fine = dataclasses.replace(problem, steps=sizes.truth_steps)
    with tempfile.TemporaryDirectory() as folder:
        file = _write(fine.work(fine.sub_rays(pixels, parts)), folder)
        worker = Worker(load_peer, "brute_jax", file)
        _, seen = worker.run("render")
        worker.close()
    return seen.reshape(len(pixels), parts**2).mean(1)


def measure(problem: Problem, peers: Sequence[str], sizes: Sizes) -> list[dict]:
    """Pictures, times and memory of all peers and of cloudjax's presets."""
    with tempfile.TemporaryDirectory() as folder:
        file = _write(problem.work(problem.grid().rays()), folder)
        workers = {name: Worker(load_peer, name, file) for name in peers}
        workers[ours.NAME] = Worker(ours.load, problem, sizes.presets)
        first = {name: worker.run("render") for name, worker in workers.items()}
        runs = in_turns([(w, "render") for w in workers.values()], sizes.repeats)
        peak = {name: worker.close() for name, worker in workers.items()}
    entries = [
        _of_peer(name, problem.steps, first[name], repeats, peak[name])
        for name, repeats in zip(peers, runs, strict=False)
    ]
    (_, cold), passes = first[ours.NAME], [found for _, found in runs[-1]]
    entries += [
        _of_preset(preset, cold, passes, peak[ours.NAME]) for preset in sizes.presets
    ]
    for entry in entries:
        work = len(entry["image"]) * entry["steps"]
        entry["ray_steps_per_second"] = work / entry["seconds"]
    check_same([e for e in entries if e["peer"]])
    return entries


def _of_peer(name: str, steps: int, first: tuple, repeats, peak_mb: float) -> dict:
    cold, image = first
    warm = median_seconds(repeats)
    return {
        "name": PEERS[name],
        "peer": True,
        "steps": steps,
        "seconds": warm,
        "everything_seconds": warm,
        "view_seconds": {},
        "compile_seconds": max(cold - warm, 0.0),
        "peak_mb": peak_mb,
        "image": image,
    }


def _of_preset(
    preset: Sequence, cold: dict, passes: Sequence[dict], peak_mb: float
) -> dict:
    """One preset, from what the first and the other passes tell of all."""
    name = ours.name_of(preset)
    return {
        "name": name,
        "peer": False,
        "steps": preset[0],
        "seconds": statistics.median(p["march"][name] for p in passes),
        "everything_seconds": statistics.median(p["whole"][name] for p in passes),
        "view_seconds": {
            phase: statistics.median(p["view"][phase] for p in passes)
            for phase in cold["view"]
        },
        "compile_seconds": cold["compile"][name],
        "peak_mb": peak_mb,
        "image": cold["images"][name][0],
    }


def _write(work, folder: str) -> Path:
    file = Path(folder) / "work.pickle"
    file.write_bytes(pickle.dumps(work))
    return file


def check_same(entries: list[dict]) -> None:
    """Peers that do not render the same picture are not compared."""
    for entry in entries[1:]:
        apart = np.abs(entry["image"] - entries[0]["image"])
        entry["apart"] = float(apart.mean())
        if entry["apart"] > SAME:
            raise RuntimeError(
                f"{entry['name']} and {entries[0]['name']} differ by {apart.mean():.1e}"
                " in the mean: they do not render the same clouds."
            )


def errors(seen: np.ndarray, truth: np.ndarray) -> dict[str, float]:
    return {
        "bias": float(seen.mean() - truth.mean()),
        "rmse": float(np.sqrt(((seen - truth) ** 2).mean())),
        "w1": float(wasserstein_distance(seen, truth)),
    }


def judge(entries: list[dict]) -> None:
    """For each peer the cheapest preset whose errors are not larger, and the ratios."""
    presets = [entry for entry in entries if not entry["peer"]]
    for peer in (entry for entry in entries if entry["peer"]):
        as_good = [
            e for e in presets if e["rmse"] <= peer["rmse"] and e["w1"] <= peer["w1"]
        ]
        best = min(as_good, key=lambda e: e["seconds"], default=None)
        peer["beaten_by"] = None if best is None else best["name"]
        if best is not None:
            peer["ratio_march"] = peer["seconds"] / best["seconds"]
            peer["ratio_everything"] = peer["seconds"] / best["everything_seconds"]


def tables(found: dict) -> str:
    parts = []
    for row in found["rows"]:
        parts += [f"### {row['title']}", "", _entries(row), ""]
        parts += [_ratios(row), ""]
    return "\n".join(parts)


def _entries(row: dict) -> str:
    head = [
        "", "march s", "view s", "all s", "ns per ray-step", "10⁶ ray-steps/s",
        "compile s", "peak MB", "bias", "RMSE", "W1",
    ]  # fmt: skip
    lines = [
        [
            e["name"],
            f"{e['seconds']:.2f}",
            "" if e["peer"] else f"{sum(e['view_seconds'].values()):.2f}",
            f"{e['everything_seconds']:.2f}",
            f"{1e9 / e['ray_steps_per_second']:.0f}",
            f"{e['ray_steps_per_second'] / 1e6:.1f}",
            f"{e['compile_seconds']:.1f}",
            f"{e['peak_mb']:.0f}",
            f"{e['bias']:+.4f}",
            f"{e['rmse']:.4f}",
            f"{e['w1']:.4f}",
        ]
        for e in row["entries"]
    ]
    return table(head, lines)


def _ratios(row: dict) -> str:
    head = ["against", "at equal or smaller error", "march only", "everything"]
    lines = [
        [
            e["name"],
            e["beaten_by"] or "none as good",
            _times(e.get("ratio_march")),
            _times(e.get("ratio_everything")),
        ]
        for e in row["entries"]
        if e["peer"]
    ]
    paper = row["gtx1650_ms"]
    if paper == paper:
        presets = [e for e in row["entries"] if not e["peer"]]
        best = min(presets, key=lambda e: e["seconds"])
        lines.append(
            [
                f"the paper's GTX 1650, {paper:.0f} ms (errors not given)",
                best["name"],
                _times(paper / 1e3 / best["seconds"]),
                _times(paper / 1e3 / best["everything_seconds"]),
            ]
        )
    return table(head, lines)


def _times(ratio: float | None) -> str:
    return "" if ratio is None else f"{ratio:.2f} x"
