"""A function called in other processes, which have more devices or work together."""

import importlib
import os
import socket
import subprocess
import sys
from pathlib import Path

import jax
import numpy as np


ROOT = Path(__file__).parents[1]
_CALL = "import sys; from tests.other_processes import keep; keep(*sys.argv[1:])"


def found_by(
    function, folder: Path, *, processes: int = 1, devices: int = 1
) -> list[list[np.ndarray]]:
    """What a function of a test module returns in each of some processes.

    **Arguments:** `function`: returns a list of arrays; `devices`: of each process.
    """
    flags = os.environ.get("XLA_FLAGS", "")
    flags += f" --xla_force_host_platform_device_count={devices}"
    address = _free_address() if processes > 1 else ""
    paths = [folder / f"{number}.npz" for number in range(processes)]
    begun = [
        subprocess.Popen(
            [
                *(sys.executable, "-c", _CALL, str(path), address),
                *(str(processes), str(number), function.__module__, function.__name__),
            ],
            cwd=ROOT,
            env=os.environ | {"XLA_FLAGS": flags, "JAX_PLATFORMS": "cpu"},
        )
        for number, path in enumerate(paths)
    ]
    assert [process.wait() for process in begun] == [0] * processes
    found = []
    for path in paths:
        with np.load(path) as arrays:
            assert int(arrays["devices"]) == processes * devices
            found.append([arrays[f"arr_{i}"] for i in range(len(arrays.files) - 1)])
    return found


def keep(path: str, address: str, processes: str, number: str, module: str, name: str):
    """What another process does."""
    if address:
        jax.distributed.initialize(address, int(processes), int(number))
    devices = np.array(jax.device_count())
    found = getattr(importlib.import_module(module), name)()
    np.savez(path, *found, devices=devices)


def _free_address() -> str:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return f"127.0.0.1:{free.getsockname()[1]}"
