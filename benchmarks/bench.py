"""cloudjax beside its peers, on this machine: python benchmarks/bench.py [-o DIR]

Renders the full discs of the paper's Table 3 with cloudjax and by the paper's algorithm
in JAX, in numba and in Dr.Jit, and measures time, memory and the error against a
converged truth; then displacement maps, derivatives, a fit, and how cost grows. Writes
bench.json, bench.md (tables) and bench.png to DIR, and with --page the page of the
documents; docs/accuracy/other_renderers.md says how to read them.
"""

import argparse
import dataclasses
import importlib
import importlib.util
import json
import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from parts.sizes import QUICK, Context, Sizes
from peers import llvm


# Imported where they run: the processes of the peers import this file, too.
PARTS = (
    "table3",
    "mesoscale",
    "displacement",
    "derivatives",
    "fitting",
    "scaling",
    "startup",
)
PAGE = """# Benchmark

Written by `benchmarks/bench.py --page`, not by hand; [beside other
renderers](other_renderers.md) says what is measured, and how.

"""
# The others compile for minutes, whatever their size.
QUICK_PARTS = ("table3", "displacement", "startup")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, default=Path("out/bench"))
    parser.add_argument("--page", type=Path, help="the page to write anew")
    parser.add_argument("--quick", action="store_true", help="small sizes: a test")
    parser.add_argument("--only", help=f"some of {','.join(PARTS)}")
    parser.add_argument("--repeats", type=int, help="of what is timed")
    options = parser.parse_args()
    every = QUICK_PARTS if options.quick else PARTS
    chosen = options.only.split(",") if options.only else every
    if unknown := [name for name in chosen if name not in PARTS]:
        parser.error(f"there is no part {unknown[0]!r}: choose of {', '.join(PARTS)}")
    options.output.mkdir(parents=True, exist_ok=True)
    sizes = QUICK if options.quick else Sizes()
    if options.repeats is not None:
        sizes = dataclasses.replace(sizes, repeats=options.repeats)
    found = run(chosen, sizes, options.quick)
    (options.output / "bench.json").write_text(json.dumps(found, indent=2) + "\n")
    text = tables(found)
    (options.output / "bench.md").write_text(text, encoding="utf-8")
    if options.page:
        options.page.write_text(PAGE + text, encoding="utf-8")
    _part("figure").draw(found["parts"], options.output / "bench.png")
    print(text)


def run(chosen: Sequence[str], sizes: Sizes, quick: bool) -> dict:
    started = time.perf_counter()

    from parts.facts import low_cloud_fraction, machine

    def log(message: str) -> None:
        seconds = time.perf_counter() - started
        print(f"[{seconds:6.0f} s] {message}", file=sys.stderr, flush=True)

    found: dict = {"machine": machine(), "notes": []}
    peers = ["brute_jax"] if quick else installed_peers(found["notes"])
    fraction, note = low_cloud_fraction(generated=quick)
    found["notes"].append(note)
    for note in found["notes"]:
        log(note)
    context = Context(sizes, tuple(peers), fraction, log)
    found["parts"] = {name: _part(name).run(context) for name in chosen}
    found["seconds"] = time.perf_counter() - started
    return found


def _part(name: str):
    return importlib.import_module(f"parts.{name}")


def installed_peers(notes: list[str]) -> list[str]:
    """Those that can run here; of the others `notes` say what is missing."""
    peers = ["brute_jax"]
    if importlib.util.find_spec("numba"):
        peers.append("brute_numba")
    else:
        notes.append("numba is left out: install it with the group `peers`.")
    if importlib.util.find_spec("drjit") is None:
        notes.append("Dr.Jit is left out: install it with the group `peers`.")
    elif (library := llvm.find()) is None:
        notes.append(
            "Dr.Jit is left out, for it needs LLVM 19: install Debian's libllvm19, or "
            "set DRJIT_LIBLLVM_PATH to the library."
        )
    else:
        os.environ["DRJIT_LIBLLVM_PATH"] = library
        peers.append("brute_drjit")
    return peers


def tables(found: dict) -> str:
    facts = [f"- {name}: {value}" for name, value in found["machine"].items()]
    notes = [f"- {note}" for note in found["notes"]]
    parts = [_part(name).tables(part) for name, part in found["parts"].items()]
    targets = _part("targets").tables(found["parts"])
    return "\n".join(
        [*facts, *notes, "", *(text for text in (targets, *parts) if text)]
    )


if __name__ == "__main__":
    main()
