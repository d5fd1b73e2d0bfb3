"""Fits of many scenes: python -m benchmarks.many_scenes GOES_FOLDER

- Joint: parts of a real scene, each fitted alone, and all fitted together. The command
  runs as users run it, one after the other in one process, so that single fits compile
  once for all parts of one structure, too.
- Workers: small made-up scenes, fitted by one worker of Dask and by two, in turns.
  Both find what is compiled in one cache, which an earlier run has filled.
"""

import argparse
import itertools
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage

from tests.generated import write_abi_l1b
from tests.scenes import write_scene

from cloudjax_data import DataError, open_folder
from cloudjax_fit import read_inputs


BANDS = (1, 3, 13)
# Rows and columns of parts that a real scene is cut into, and how many of them are
# fitted, the cloudiest.
PARTS = (6, 3)
FITTED = 8
# Of the march, so that eight fits are done in half an hour.
FEWER_STEPS = ("--steps", "6")
# Of a made-up scene: enough for a fit that steps a few times.
SMALL = ("--bands", "13", "--rays", "512", "--steps", "6", "--max-steps", "8")


def _parts(folder: str, out: Path) -> list[Path]:
    """Scene folders of parts of a real scene, on the coarsest grid of its bands."""
    scene = open_folder(folder).read(BANDS).on_common_grid()
    made = []
    for i in range(PARTS[0] * PARTS[1]):
        made.append(out / f"part{i}")
        made[-1].mkdir(parents=True, exist_ok=True)
        for number, band in scene.bands.items():
            rows, columns = (
                slice(k * size // count, (k + 1) * size // count)
                for k, size, count in zip(
                    divmod(i, PARTS[1]), band.radiance.shape, PARTS, strict=True
                )
            )
            write_abi_l1b(
                made[-1],
                band=number,
                radiance=band.radiance[rows, columns],
                grid=replace(
                    band.grid,
                    x_rad=band.grid.x_rad[columns],
                    y_rad=band.grid.y_rad[rows],
                ),
                start=band.start,
                platform=band.platform,
            )
    return sorted(made, key=_cloud_fraction)[-FITTED:]


def _cloud_fraction(part: Path) -> float:
    """None where there is too little to fit."""
    try:
        return read_inputs(part, bands=BANDS).target.cloud_fraction
    except DataError:
        return 0.0


def _fit(scenes: list[Path], out: Path, *options: str) -> dict[str, float]:
    """Wall and CPU seconds of the command."""
    command = [sys.executable, "-m", "cloudjax_cli", "fit", *map(str, scenes)]
    before, started = getrusage(RUSAGE_CHILDREN), time.perf_counter()
    done = subprocess.run(
        [*command, "-o", str(out), *options],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode not in (0, 1):
        raise SystemExit(done.stderr)
    after = getrusage(RUSAGE_CHILDREN)
    cpu = sum(getattr(after, k) - getattr(before, k) for k in ("ru_utime", "ru_stime"))
    return {"seconds": time.perf_counter() - started, "cpu_seconds": cpu}


def joint(folder: str, out: Path) -> Iterator[tuple[str, dict[str, float]]]:
    """Parts of a scene alone and together."""
    parts = _parts(folder, out / "parts")
    options = "--bands", ",".join(map(str, BANDS)), *FEWER_STEPS
    yield f"{len(parts)} scenes, each alone", _fit(parts, out / "alone", *options)
    together = _fit(parts, out / "together", "--joint", *options)
    yield f"{len(parts)} scenes together", together


def workers(out: Path, count: int) -> Iterator[tuple[str, dict[str, float]]]:
    """Made-up scenes by one worker and by two, with all compiled."""
    scenes = [
        write_scene(out / "made" / f"scene{i:02d}", (13,), seed=i) for i in range(count)
    ]
    os.environ["JAX_COMPILATION_CACHE_DIR"] = str(out / "cache")
    _fit(scenes[:2], out / "warm", *SMALL, "--dask", "local:1")
    for n in (1, 2):
        found = _fit(scenes, out / f"by{n}", *SMALL, "--dask", f"local:{n}")
        yield f"{count} small scenes, {n} worker{'s' * (n > 1)}", found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("goes", nargs="?", help="the folder of a scene; none: workers")
    parser.add_argument("-o", "--output", default="out/many_scenes")
    parser.add_argument("--small", type=int, default=50, help="made-up scenes, or 0")
    options = parser.parse_args()
    out, found = Path(options.output), {}
    out.mkdir(parents=True, exist_ok=True)
    rows = itertools.chain(
        joint(options.goes, out) if options.goes else (),
        workers(out, options.small) if options.small else (),
    )
    for name, row in rows:
        found[name] = row
        told = f"{row['seconds']:7.0f} s, CPU {row['cpu_seconds']:7.0f} s"
        print(f"{name:34} {told}", flush=True)
    (out / "many_scenes.json").write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
