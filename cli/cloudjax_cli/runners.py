"""Where tasks run: one after the other in this process, or on the workers of Dask."""

import functools as ft
import importlib.util
import logging
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, TypeVar, cast, runtime_checkable

import click

from .held_memory import forget_if_much


if TYPE_CHECKING:
    from distributed import Client, Future


Task = TypeVar("Task")
Result = TypeVar("Result")

# Seconds to wait for a cluster that answers.
_PATIENCE_S = 20


@runtime_checkable
class Runner(Protocol):
    """Runs tasks that know nothing of each other."""

    def run(
        self, work: Callable[[Task], Result], tasks: Sequence[Task]
    ) -> Iterator[tuple[Task, Result | Exception]]:
        """Yield each task with its result as soon as it has ended.

        **Arguments:** `work`: a function that can be pickled, as the tasks can.

        **Returns:** an exception in place of a result that was lost with its worker.
        """
        ...


class Here:
    """Runs tasks one after the other, in this process."""

    def run(
        self, work: Callable[[Task], Result], tasks: Sequence[Task]
    ) -> Iterator[tuple[Task, Result | Exception]]:
        """See `Runner`."""
        for task in tasks:
            yield task, _in_its_turn(work, task)


@dataclass(frozen=True)
class OnDask:
    """Runs tasks on a cluster of Dask, which gives those of a lost worker to another.

    **Fields:**

    - `address`: of the scheduler; None for a cluster of this machine's own.
    - `workers`: of that cluster; None for as many as there are cores.
    """

    address: str | None = None
    workers: int | None = None

    def run(
        self, work: Callable[[Task], Result], tasks: Sequence[Task]
    ) -> Iterator[tuple[Task, Result | Exception]]:
        """See `Runner`."""
        from distributed import as_completed

        work = ft.partial(_on_own_cores, work, self._shares())
        with self._client() as client:
            # Not pure: a task is done because it is asked for, done before or not.
            begun = {client.submit(work, task, pure=False): task for task in tasks}
            for future in as_completed(list(begun)):
                task, result = begun.pop(future), _result_of(future)
                # What a lost worker still held for someone is done again.
                future.release()
                yield task, result

    @contextmanager
    def _client(self) -> "Iterator[Client]":
        from distributed import Client, LocalCluster

        if self.address is not None:
            with _connected(self.address) as client:
                yield client
            return
        with (
            LocalCluster(
                n_workers=len(self._shares()),
                threads_per_worker=1,
                # Memory is the system's business: a killed fit would only be repeated.
                memory_limit=None,
                # None is no dashboard, whatever the annotation says.
                dashboard_address=cast(str, None),
                silence_logs=logging.CRITICAL,
            ) as cluster,
            Client(cluster) as client,
        ):
            yield client

    def _shares(self) -> list[list[int]]:
        """The cores of each worker of this machine's own cluster."""
        if self.address is not None:
            return []
        cores = _cores()
        count = self.workers or len(cores)
        return [cores[i::count] or [cores[i % len(cores)]] for i in range(count)]


def _result_of(future: "Future") -> Any:
    try:
        return future.result()
    except Exception as error:
        from cloudjax_data import DataError

        return DataError(
            f"no worker of Dask could do it ({type(error).__name__}: {error}): see "
            "that workers have cloudjax, enough memory and the same paths."
        )


class Cluster(click.ParamType):
    """`local`, `local:N` or the address of a scheduler, as a runner."""

    name = "local[:N]|ADDRESS"

    def convert(self, value, param, ctx):
        if isinstance(value, OnDask):
            return value
        if importlib.util.find_spec("distributed") is None:
            self.fail("Dask is not installed: pip install 'cloudjax[cluster]'")
        kind, _, number = value.partition(":")
        if kind != "local":
            return OnDask(value)
        if value == "local":
            return OnDask()
        if not number.isdecimal() or int(number) < 1:
            self.fail(f"{value!r} has no number of workers such as local:4")
        return OnDask(workers=int(number))


def _connected(address: str) -> "Client":
    from distributed import Client

    from cloudjax_data import DataError

    try:
        return Client(address, timeout=_PATIENCE_S)
    except (OSError, ValueError) as error:
        raise DataError(
            f"no scheduler of Dask answers at {address} ({error}): start one there, or "
            "give --dask local."
        ) from error


def _cores() -> list[int]:
    if hasattr(os, "sched_getaffinity"):
        return sorted(os.sched_getaffinity(0))
    return list(range(os.cpu_count() or 1))


def _on_own_cores(
    work: Callable[[Task], Result], shares: list[list[int]], task: Task
) -> Result:
    """Work on a worker's share of the cores, where there are shares.

    Each time, for a worker that replaces a lost one knows nothing; before the first
    task has XLA start as many threads as there are cores.
    """
    if shares and hasattr(os, "sched_setaffinity"):
        from distributed import get_worker

        os.sched_setaffinity(0, shares[int(get_worker().name)])
    return _in_its_turn(work, task)


def _in_its_turn(work: Callable[[Task], Result], task: Task) -> Result:
    """Work, in a process that has worked and will again."""
    result = work(task)
    forget_if_much()
    return result
