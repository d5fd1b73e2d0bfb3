"""How long the command line takes to say what it can do."""

import statistics
import subprocess
import sys
import time

from .sizes import Context
from .text import table


COMMANDS = {
    "cloudjax --help": "from cloudjax_cli import main; main(['--help'])",
    "python -c 'import cloudjax'": "import cloudjax",
    "python -c 'pass'": "pass",
}


def run(context: Context) -> dict:
    context.log("startup")
    seconds: dict[str, list[float]] = {name: [] for name in COMMANDS}
    for _ in range(2 * context.sizes.repeats + 1):
        for name, code in COMMANDS.items():
            started = time.perf_counter()
            subprocess.run(
                [sys.executable, "-c", code], check=True, capture_output=True
            )
            seconds[name].append(time.perf_counter() - started)
    # The first of each fills the file cache.
    return {
        "seconds": {
            name: statistics.median(taken[1:]) for name, taken in seconds.items()
        }
    }


def tables(found: dict) -> str:
    lines = [[f"`{name}`", f"{s:.2f}"] for name, s in found["seconds"].items()]
    return "\n".join(["### Start-up", "", table(["", "s"], lines), ""])
