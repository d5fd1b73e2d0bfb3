"""Machines, of which times are, and by which times of others are told."""

import functools as ft
import os
import platform
import statistics
import time
from dataclasses import dataclass

import jax
import jax.numpy as jnp


# The first tenths of a second of a process are up to 1.6 times slower than the others
# (2 cores), and what else a machine does comes and goes within tenths, too.
_WARM_S, _LOOK_S = 0.3, 0.5


@dataclass(frozen=True)
class Machine:
    """A `Machine` is what times are of.

    **Fields:**

    - `name`: its cores and its processor.
    - `work_s`: that a piece of work takes there which is like a render's, for times of
      one machine to be told on another.
    """

    name: str
    work_s: float

    @staticmethod
    @ft.cache
    def here() -> "Machine":
        """Name this machine, and time the piece of work."""
        device = jax.devices()[0]
        kind = platform.machine() if device.platform == "cpu" else device.device_kind
        return Machine(f"{os.cpu_count()} cores, {kind}", _work_s())


def _work_s() -> float:
    """Exponentials and sums over tables that a cache holds, as in the march.

    The median, for renders share the machine with what else it does.
    """

    @jax.jit
    def work(x):
        for _ in range(8):
            x = jnp.exp(-jnp.abs(x)) @ jnp.full((64, 64), 1 / 64, x.dtype)
        return x

    start = jnp.linspace(0, 1, 1 << 20, dtype=jnp.float32).reshape(-1, 64)
    work(start).block_until_ready()
    took, began = [], time.perf_counter()
    while (now := time.perf_counter()) < began + _WARM_S + _LOOK_S:
        work(start).block_until_ready()
        if now > began + _WARM_S:
            took.append(time.perf_counter() - now)
    return statistics.median(took)
