"""What is compared runs in processes of its own, whose peak memory is then its own.

All processes of one comparison are alive together and are told to run in turns, so that
whatever else the machine does falls on all of them alike.
"""

import importlib
import multiprocessing
import os
import pickle
import resource
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any


class Worker:
    """A process that holds functions without arguments, to be run by name.

    **Arguments:** `make`: called in the process with `arguments`, returns the
    functions by name.
    """

    def __init__(self, make: Callable[..., dict[str, Callable]], *arguments):
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(
            target=_serve, args=(theirs, make, arguments), daemon=True
        )
        self._process.start()
        theirs.close()

    def run(self, name: str) -> tuple[float, Any]:
        """Seconds and what the function returned."""
        self._pipe.send(name)
        return self._answer()

    def close(self) -> float:
        """End the process. **Returns:** its peak resident memory in MB."""
        self._pipe.send(None)
        peak = self._answer()
        self._process.join()
        return peak

    def _answer(self):
        try:
            return self._pipe.recv()
        except EOFError:
            self._process.join()
            raise RuntimeError(
                f"A process of the benchmark ended with code {self._process.exitcode}."
            ) from None


def _serve(pipe, make, arguments) -> None:
    functions = make(*arguments)
    while (name := pipe.recv()) is not None:
        started = time.perf_counter()
        found = functions[name]()
        pipe.send((time.perf_counter() - started, found))
    pipe.send(peak_mb())


def peak_mb() -> float:
    """Peak resident memory of this process."""
    # Linux carries `ru_maxrss` over from the process that started this one.
    status = Path("/proc/self/status")
    if status.exists():
        (line,) = (x for x in status.read_text().splitlines() if x[:6] == "VmHWM:")
        return int(line.split()[1]) * 1024 / 1e6
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6


def in_turns(
    runs: Sequence[tuple[Worker, str]], repeats: int, enough_s: float = 60.0
) -> list[list[tuple[float, Any]]]:
    """Seconds and results of each, in turns; fewer repeats of what takes long."""
    done: list[list[tuple[float, Any]]] = [[] for _ in runs]
    for _ in range(repeats):
        for (worker, name), results in zip(runs, done, strict=True):
            if sum(seconds for seconds, _ in results) < enough_s:
                results.append(worker.run(name))
    return done


def median_seconds(results: list[tuple[float, Any]]) -> float:
    return statistics.median(seconds for seconds, _ in results)


def load_peer(name: str, file: Path) -> dict[str, Callable]:
    """A peer's rendering of the pickled work in a file."""
    # Dr.Jit keeps kernels in the home directory, which would hide what compiling costs.
    os.environ["HOME"] = tempfile.mkdtemp(dir=file.parent)
    module = importlib.import_module(f"peers.{name}")
    return {"render": module.prepare(pickle.loads(file.read_bytes()))}
