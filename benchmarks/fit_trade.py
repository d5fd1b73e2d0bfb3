"""What a fit's knobs cost and buy: python -m benchmarks.fit_trade -o DIR

Fits the scene that comes with the package once for each choice of rays, steps and
precision, each in a process of its own, and compares it with the dearest: by how many
standard deviations of that fit the parameters that it determines have moved, and how
far the image is from the observed one. Prints a table, and writes it with the numbers
after each fit.
"""

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cloudjax_data.whole_files import write_text_whole

from .intervals import deviations
from .parts import text


@dataclass(frozen=True)
class Knobs:
    """What a fit spends time on."""

    rays: int = 8192
    steps: int = 24
    double: bool = False


# The dearest first: others are compared with it.
REFERENCE = Knobs(rays=16384, steps=48)
TURNED = (
    Knobs(),
    *(Knobs(rays=rays) for rays in (1024, 2048, 4096, 16384)),
    *(Knobs(steps=steps) for steps in (6, 12, 48)),
    Knobs(rays=2048, steps=12),
    Knobs(double=True),
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=Path("out/fit_trade"))
    parser.add_argument("--light", default="physical")
    parser.add_argument("--of", help="knobs as JSON: prints one fit")
    asked = parser.parse_args()
    if asked.of is not None:
        print(json.dumps(fitted(Knobs(**json.loads(asked.of)), asked.light)))
        return
    asked.output.mkdir(parents=True, exist_ok=True)
    rows: list[dict[str, Any]] = []
    for knobs in (REFERENCE, *TURNED):
        rows.append({"knobs": asdict(knobs)} | _apart(knobs, asked.light))
        numbers = {"light": asked.light, "fits": rows}
        write_text_whole(
            asked.output / "fit_trade.json", json.dumps(numbers, indent=1) + "\n"
        )
        write_text_whole(asked.output / "fit_trade.md", table(rows))
        print(table(rows).splitlines()[-1], flush=True)
    print(table(rows))


def _apart(knobs: Knobs, light: str) -> dict[str, Any]:
    """Fit in a process of its own, whose precision is its own."""
    command = [sys.executable, "-m", "benchmarks.fit_trade"]
    done = subprocess.run(
        [*command, "--light", light, "--of", json.dumps(asdict(knobs))],
        env=os.environ | {"JAX_ENABLE_X64": str(int(knobs.double))},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    return json.loads(done.stdout.splitlines()[-1])


def fitted(knobs: Knobs, light: str) -> dict[str, Any]:
    """Fit the scene that comes with the package, from its defaults."""
    from cloudjax_fit import FitSettings, embedded_target, fit

    settings = FitSettings(rays=knobs.rays, steps=knobs.steps, light=light)
    found = fit(embedded_target(), settings=settings)
    return {
        "state": found.state,
        "solver_steps": len(found.history) - 1,
        "seconds": found.seconds,
        "w1_over_std": {n: d.w1_over_std for n, d in found.distances_fit.items()},
        "estimates": {
            e.parameter.name: {
                "value": e.value,
                "std": e.std,
                "determined": e.determined,
                "log": e.parameter.log,
            }
            for e in found.estimates
        },
    }


def moved(fit: dict[str, Any], reference: dict[str, Any]) -> np.ndarray:
    """By how many standard deviations what the reference determines has moved."""
    return np.abs(
        [
            deviations({**wanted, "truth": fit["estimates"][name]["value"]})
            for name, wanted in reference["estimates"].items()
            if wanted["determined"]
        ]
    )


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Write the fits as Markdown."""
    bands = list(rows[0]["w1_over_std"])
    head = [
        "rays",
        "steps",
        "floats",
        "solver steps",
        "converged",
        "compile s",
        "solve s",
    ]
    head += [f"W1/std C{int(number):02d}" for number in bands]
    head += ["moved, median", "most"]
    lines = []
    for row in rows:
        knobs, off = row["knobs"], moved(row, rows[0])
        lines.append(
            [
                str(knobs["rays"]),
                str(knobs["steps"]),
                "64 bit" if knobs["double"] else "32 bit",
                str(row["solver_steps"]),
                "yes" if row["state"] == "converged" else "no",
                *(f"{row['seconds'][phase]:.0f}" for phase in ("compile", "solve")),
                *(f"{row['w1_over_std'][number]:.3f}" for number in bands),
                f"{np.median(off):.2f}",
                f"{off.max():.1f}",
            ]
        )
    return text.table(head, lines)


if __name__ == "__main__":
    main()
