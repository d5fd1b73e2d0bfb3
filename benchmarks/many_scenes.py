"""Fits of many scenes: python -m benchmarks.many_scenes -o DIR

- Joint: some made-up scenes, each fitted alone, and all fitted together. The command
  runs as users run it, one scene after the other in one process, so that single fits
  compile once, too.
- Workers: smaller ones, fitted by one worker of Dask and by two. Both find what is
  compiled in one cache, which an earlier run has filled.
"""

import argparse
import itertools
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage

from tests.scenes import write_scene


# Pixels of a scene that is fitted alone or with others, more than a fit has rays; and
# of a small one.
SHAPE, SMALL_SHAPE = (120, 120), (60, 60)
# Of fits of both kinds: in one band, with few steps of the march.
SHORT = ("--bands", "13", "--steps", "6")
# Of small scenes: enough for a fit that steps a few times.
SMALL = ("--bands", "13", "--rays", "512", "--steps", "6", "--max-steps", "8")


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


def joint(out: Path, count: int) -> Iterator[tuple[str, dict[str, float]]]:
    """Scenes alone and together, with nothing compiled before."""
    scenes = [
        write_scene(out / "parts" / f"scene{i}", (13,), seed=10 * i, shape=SHAPE)
        for i in range(count)
    ]
    for name, options in ("each alone", ()), ("together", ("--joint",)):
        os.environ["JAX_COMPILATION_CACHE_DIR"] = str(out / f"cache {name}")
        found = _fit(scenes, out / name, *SHORT, *options)
        yield f"{count} scenes, {name}", found


def workers(out: Path, count: int) -> Iterator[tuple[str, dict[str, float]]]:
    """Made-up scenes by one worker and by two, with all compiled."""
    scenes = [
        write_scene(out / "made" / f"scene{i:02d}", (13,), seed=i, shape=SMALL_SHAPE)
        for i in range(count)
    ]
    os.environ["JAX_COMPILATION_CACHE_DIR"] = str(out / "cache")
    _fit(scenes[:2], out / "warm", *SMALL, "--dask", "local:1")
    for n in (1, 2):
        found = _fit(scenes, out / f"by{n}", *SMALL, "--dask", f"local:{n}")
        yield f"{count} small scenes, {n} worker{'s' * (n > 1)}", found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", default="out/many_scenes")
    parser.add_argument("--joint", type=int, default=8, help="scenes, or 0")
    parser.add_argument("--small", type=int, default=50, help="small scenes, or 0")
    options = parser.parse_args()
    out, found = Path(options.output), {}
    out.mkdir(parents=True, exist_ok=True)
    rows = itertools.chain(
        joint(out, options.joint) if options.joint else (),
        workers(out, options.small) if options.small else (),
    )
    for name, row in rows:
        found[name] = row
        told = f"{row['seconds']:7.0f} s, CPU {row['cpu_seconds']:7.0f} s"
        print(f"{name:34} {told}", flush=True)
    (out / "many_scenes.json").write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
