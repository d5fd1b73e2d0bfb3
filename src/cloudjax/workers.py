"""Work is shared among all cores: numpy and XLA let other threads run."""

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

import jax


Job = TypeVar("Job")
Result = TypeVar("Result")


def each(jobs: Iterable[Job], work: Callable[[Job], Result]) -> Iterator[Result]:
    """Return results in order, of as many jobs at once as there are cores, and one
    more.
    """
    workers = _count()
    waiting: deque = deque()
    precision = jax.config.jax_enable_x64  # pyright: ignore[reportAttributeAccessIssue]

    def in_precision(job: Any) -> Any:
        # Which is each thread's own.
        with jax.enable_x64(precision):
            return work(job)

    with ThreadPoolExecutor(workers) as pool:
        for job in jobs:
            waiting.append(pool.submit(in_precision, job))
            if len(waiting) > workers:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()


def _count() -> int:
    """Other devices than one CPU share out their work themselves."""
    if jax.default_backend() != "cpu" or jax.local_device_count() > 1:
        return 1
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 2
