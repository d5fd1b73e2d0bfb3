"""How often fits' intervals cover the truth: python benchmarks/intervals.py -o DIR

Each twin is a part of the embedded scene, with parameters drawn from their priors, the
noise of the instrument and a seed of its own for its textures. It is fitted from the
defaults with another seed, as clouds of nature have none of ours. Of the parameters
that a fit calls determined, the interval of one standard deviation should hold the
truth in 68 %, and of two in 95 %.
"""

import argparse
import importlib
import json
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np

from cloudjax.light.planck import radiance as radiance_of
from cloudjax_cli.runners import Here, OnDask
from cloudjax_data.whole_files import write_text_whole
from cloudjax_fit import embedded_target
from cloudjax_fit.fit_settings import FitSettings
from cloudjax_fit.fittable_scene import FittableScene
from cloudjax_fit.observation import target_of
from cloudjax_fit.parameters import values_of
from cloudjax_fit.solver import Solver
from cloudjax_fit.targets import Target
from cloudjax_fit.uncertainty import estimate
from cloudjax_scenes.imagery import Imagery
from cloudjax_scenes.simulated_image import simulate_image


# Of the embedded scene: low cloud and cirrus over sea.
ROWS, COLUMNS = slice(300, 420), slice(60, 180)
# Of the instrument, of a radiance at albedo 1 and of a brightness temperature: what
# neighbouring pixels of GOES-17 differ by in the calmest places of a scene, in bands 1
# and 3 (1 km) and in band 13. ABI's requirement is 300 and 0.1 K.
SIGNAL_TO_NOISE, NOISE_K = 2000.0, 0.04
# Seeds of truths and of fits never meet.
FIT_SEED = 1_000_000


@dataclass(frozen=True)
class Twin:
    """A twin to fit.

    **Fields:** `number`: the seed of its textures, truth and noise; `settings`: of the
    fit.
    """

    number: int
    settings: FitSettings

    def __call__(self) -> dict[str, Any]:
        """Fit it, and return what was found of each parameter beside the truth."""
        started = time.perf_counter()
        imagery = _part(embedded_target().imagery)
        target, truth = _observed(imagery, self.settings, self.number)
        settings = replace(self.settings, seed=FIT_SEED + self.number)
        scene = FittableScene.of(target, settings)
        problem = scene.pose()
        start = jnp.zeros(len(scene.free))
        solver = Solver(problem, max_steps=settings.max_steps)
        solution = solver(problem, start)
        quarters, seed = solver.quarters(problem, solution.z), settings.seed
        found, _ = estimate(problem, scene.free, start, solution, quarters, seed=seed)
        return {
            "twin": self.number,
            "converged": solution.converged,
            "loss": solution.loss,
            "steps": len(solution.history) - 1,
            "seconds": time.perf_counter() - started,
            "parameters": [
                {
                    "name": each.parameter.name,
                    "truth": truth[each.parameter.name],
                    "value": each.value,
                    "std": each.std,
                    "determined": each.determined,
                    "log": each.parameter.log,
                }
                for each in found
            ],
        }


def _part(imagery: Imagery) -> Imagery:
    grid = imagery.grid
    part = replace(grid, x_rad=grid.x_rad[COLUMNS], y_rad=grid.y_rad[ROWS])
    return replace(imagery, grid=part)


def _observed(
    imagery: Imagery, settings: FitSettings, seed: int
) -> tuple[Target, dict[str, float]]:
    """The image of clouds whose parameters are drawn from their priors, and these."""
    rng = np.random.default_rng(seed)
    blank = np.ones(imagery.grid.shape, bool)
    sky = {n: np.ones(imagery.grid.shape) for n in imagery.bands}
    settings = replace(settings, seed=seed)
    scene = FittableScene.of(target_of(imagery, sky, blank), settings)
    z = jnp.asarray(rng.standard_normal(len(scene.free)), float)
    values = np.asarray(values_of(scene.free, z), float)
    truth = {p.name: float(v) for p, v in zip(scene.free, values, strict=True)}
    image = simulate_image(scene.with_values(truth), scene.made_of)
    seen = {
        number: image.band(number) + _noise(imagery, number, image.band(number), rng)
        for number in imagery.bands
    }
    return target_of(imagery, seen, np.isfinite(image.radiance).all(0)), truth


def _noise(imagery: Imagery, number: int, radiance, rng: np.random.Generator):
    told = imagery.coefficients(number)
    if imagery.bands[number].reflective:
        size = 1 / told["kappa0"] / SIGNAL_TO_NOISE
    else:
        # By how much a radiance near that of 300 K changes.
        coefficients = (told[name] for name in ("fk1", "fk2", "bc1", "bc2"))
        low, high = radiance_of(*coefficients, np.array([300.0, 300.0 + NOISE_K]))
        size = high - low
    return size * rng.standard_normal(radiance.shape)


def table(twins: Sequence[dict[str, Any]]) -> dict[str, dict[str, float]]:
    """Shares of intervals that cover the truth, of determined parameters, by name."""
    rows: dict[str, list[float]] = {}
    for twin in twins:
        for each in twin["parameters"]:
            if each["determined"]:
                off = deviations(each)
                rows.setdefault(each["name"], []).append(off)
                rows.setdefault("all", []).append(off)
    return {
        name: {
            "determined": len(off),
            "within_1": float((np.abs(off) < 1).mean()),
            "within_2": float((np.abs(off) < 2).mean()),
            "mean": float(np.mean(off)),
            "rms": float(np.sqrt(np.mean(np.square(off)))),
        }
        for name, off in rows.items()
    }


def deviations(each: dict[str, Any]) -> float:
    """Of the truth from what was found, in standard deviations."""
    value, truth, std = each["value"], each["truth"], each["std"]
    if each["log"]:
        return float(np.log(value / truth) / (std / value))
    return float((value - truth) / std)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", default="out/intervals")
    parser.add_argument("--twins", type=int, default=100)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--rays", type=int, default=4096)
    parser.add_argument("--steps", type=int, default=12)
    parser.add_argument("--max-steps", type=int, default=60)
    options = parser.parse_args()
    settings = FitSettings(
        rays=options.rays, steps=options.steps, max_steps=options.max_steps
    )
    tasks = [Twin(number, settings) for number in range(options.twins)]
    runner = Here() if options.workers == 1 else OnDask(workers=options.workers)
    done = []
    path = Path(options.output) / "intervals.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    for task, found in runner.run(_do, tasks):
        if isinstance(found, Exception):
            print(f"twin {task.number}: {found}", flush=True)
            continue
        done.append(found)
        print(
            f"twin {task.number}: {'' if found['converged'] else 'not '}converged, "
            f"loss {found['loss']:.0f}, {found['steps']} steps, "
            f"{found['seconds']:.0f} s",
            flush=True,
        )
        content = {"settings": vars(options), "table": table(done), "twins": done}
        write_text_whole(path, json.dumps(content, indent=1))
    print(f"{'':34}  fits  within 1 std  within 2   mean    rms")
    for name, row in table(done).items():
        print(
            f"{name:34} {row['determined']:5d} {row['within_1']:12.2f} "
            f"{row['within_2']:10.2f} {row['mean']:+7.2f} {row['rms']:6.2f}"
        )


def _do(task: Twin) -> dict[str, Any]:
    return task()


if __name__ == "__main__":
    # By its own name: workers import it, once, and keep the solver that they compiled.
    importlib.import_module(Path(__file__).stem).main()
