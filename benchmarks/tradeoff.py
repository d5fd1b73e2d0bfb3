"""What accuracy costs on this machine: python benchmarks/tradeoff.py [-o DIR]

The embedded scene is fitted with several numbers of rays, and the scene of the last fit
is rendered with several numbers of steps. Writes tradeoff.json, tradeoff.md
(tables) and tradeoff.png to DIR. Times of renderings are medians of warm, interleaved
repeats; each fit is done once.
"""

import argparse
import json
import os
import platform
import statistics
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

from cloudjax import Scene, prepare, render
from cloudjax_data import sun_direction
from cloudjax_fit.embedded import embedded_target
from cloudjax_fit.histogram import distances
from cloudjax_fit.objective import pose
from cloudjax_fit.parameters import put_all, unbounded_of, values_of
from cloudjax_fit.scene_parameters import scene_parameters
from cloudjax_fit.solver import Solver
from cloudjax_fit.targets import Target
from cloudjax_fit.versions import versions
from cloudjax_scenes import SceneFromImagery, SimulatedImage, simulate_image
from cloudjax_scenes.quality import Quality
from cloudjax_scenes.trade.trial import band_error


RAYS = (1024, 2048, 4096, 8192)
STEPS = (6, 12, 24, 48, 96)
REFERENCE = 192
REPEATS = 3
# Of the pixels, this one in so many is rendered.
THINNING = 5


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=Path("out/tradeoff"))
    folder = parser.parse_args().output
    folder.mkdir(parents=True, exist_ok=True)
    target = embedded_target()
    fits, scene = run_fits(target)
    found = {
        "machine": f"{os.cpu_count()} cores, {platform.machine()}",
        "device": jax.devices()[0].device_kind,
        "versions": versions(),
        "pixels": list(target.imagery.grid.shape),
        "thinning": THINNING,
        "bands": list(target.quantiles),
        "fits": fits,
        "renderings": run_renderings(target, scene),
    }
    (folder / "tradeoff.json").write_text(json.dumps(found, indent=2) + "\n")
    (folder / "tradeoff.md").write_text(tables(found), encoding="utf-8")
    draw(found, folder / "tradeoff.png")
    print(tables(found))


def run_fits(target: Target) -> tuple[list[dict], Scene]:
    """As `cloudjax_fit.fit`, without its uncertainties and its image of the start."""
    made_of = SceneFromImagery(target.imagery)
    scene = made_of.build()
    parameters = [p for p in scene_parameters(made_of) if p.free]
    rows = []
    for rays in RAYS:
        problem, _ = pose(target, scene, parameters, rays=rays, seed=0)
        solver = Solver(problem)
        found = solver(problem, unbounded_of(parameters))
        fitted = put_all(scene, parameters, values_of(parameters, jnp.asarray(found.z)))
        image = simulate_image(fitted, made_of)
        rows.append(
            {
                "rays": rays,
                "converged": found.converged,
                "steps": len(found.history) - 1,
                "compile_seconds": solver.compile_seconds,
                "solve_seconds": found.seconds,
                "w1_over_std": _w1_over_std(target, image),
            }
        )
        print(rows[-1], flush=True)
    return rows, fitted


def _w1_over_std(target: Target, image: SimulatedImage) -> dict[int, float]:
    weights = image.cloud.reshape(-1)
    return {
        n: distances(observed, image.band(n).reshape(-1), weights).w1_over_std
        for n, observed in target.quantiles.items()
    }


def run_renderings(target: Target, scene: Scene) -> list[dict]:
    """Each case once for its image and to compile, then all of them in turns."""
    every, _ = target.imagery.on_earth()
    rays = every[::THINNING]
    sun = sun_direction(target.imagery.time)

    def prepared(steps: int) -> Callable[[], np.ndarray]:
        of_steps = Quality(steps=steps).of_scene(scene)
        image = prepare(of_steps, rays, sun)

        def run() -> np.ndarray:
            seen = render(of_steps, image)
            return np.asarray(scene.total(seen.radiances), np.float64)

        return run

    truth = prepared(REFERENCE)()
    cases = {steps: prepared(steps) for steps in STEPS}
    rows = [
        {"steps": steps} | _errors(scene.bands, run(), truth)
        for steps, run in cases.items()
    ]
    seconds = {case: [] for case in cases}
    for _ in range(REPEATS):
        for case, run in cases.items():
            started = time.perf_counter()
            run()
            seconds[case].append(time.perf_counter() - started)
    for row, case in zip(rows, cases, strict=True):
        row["seconds"] = statistics.median(seconds[case])
        print(row, flush=True)
    return rows


def _errors(bands: Sequence[int], image: np.ndarray, truth: np.ndarray) -> dict:
    """Of all pixels, over the standard deviation of the reference."""
    found = dict(zip(bands, map(band_error, image, truth), strict=True))
    return {
        "rmse_over_std": {number: error.rmse for number, error in found.items()},
        "w1_over_std": {number: error.w1 for number, error in found.items()},
    }


# The outcome --------------------------------------------------------------------------


def tables(found: dict) -> str:
    names = [f"C{n:02d}" for n in found["bands"]]
    fits = [
        [f["rays"], f["steps"], "yes" if f["converged"] else "no"]
        + [f"{f[f'{phase}_seconds']:.1f}" for phase in ("compile", "solve")]
        + [f"{w:.3f}" for w in f["w1_over_std"].values()]
        for f in found["fits"]
    ]
    renderings = [
        [r["steps"], f"{r['seconds']:.2f}"]
        + [f"{e:.3f}" for e in r["rmse_over_std"].values()]
        + [f"{e:.4f}" for e in r["w1_over_std"].values()]
        for r in found["renderings"]
    ]
    return "\n".join(
        [
            *_table(
                ["rays", "solver steps", "converged", "compile s", "solve s"]
                + [f"W1/std {name}" for name in names],
                fits,
            ),
            "",
            *_table(
                ["march steps", "render s"]
                + [f"RMSE/std {name}" for name in names]
                + [f"W1/std {name}" for name in names],
                renderings,
            ),
            "",
        ]
    )


def _table(head: list[str], rows: list[list]) -> list[str]:
    lines = [head, ["--:"] * len(head), *rows]
    return ["| " + " | ".join(map(str, line)) + " |" for line in lines]


def draw(found: dict, path: Path) -> None:
    figure = Figure(figsize=(9, 3.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    for colour, number in zip(("C0", "C1", "C3"), found["bands"], strict=False):
        left.loglog(
            [r["seconds"] for r in found["renderings"]],
            [r["rmse_over_std"][number] for r in found["renderings"]],
            color=colour,
            marker="o",
            markersize=3,
            label=f"C{number:02d}",
        )
        right.plot(
            [f["rays"] for f in found["fits"]],
            [f["w1_over_std"][number] for f in found["fits"]],
            color=colour,
            marker="o",
            markersize=3,
            label=f"C{number:02d}",
        )
    left.set(
        xlabel=f"rendering, s ({', '.join(map(str, STEPS))} steps)",
        ylabel=f"pixel RMSE/std against {REFERENCE} steps",
    )
    right.set(xlabel="rays", ylabel="W1/std of the fitted image", xscale="log")
    right.set_xticks(RAYS, map(str, RAYS))
    right.set_ylim(bottom=0)
    left.set_xticks((0.5, 1, 2, 5, 10), ("0.5", "1", "2", "5", "10"))
    for axes in (left, right):
        axes.xaxis.set_minor_formatter("")
        axes.grid(alpha=0.3)
        axes.legend(fontsize=7)
    figure.savefig(path, dpi=110, metadata={"Software": None})


if __name__ == "__main__":
    main()
