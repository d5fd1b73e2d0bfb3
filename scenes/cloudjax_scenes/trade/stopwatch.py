"""How long work takes, and how much of that jax compiles."""

import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import TypeVar

import jax.monitoring


Item = TypeVar("Item")
# What jax tells of tracing, lowering and compiling, or of reading what is compiled.
_COMPILING = "/jax/core/compile/"


class Stopwatch:
    """A `Stopwatch` adds up the wall time of parts of a work, compiling apart.

    What jax compiles is told when it ends, by any thread, and parts lie within others:
    what counts is the time that they cover together.
    """

    def __init__(self):
        self._whole_s = 0.0
        self._compiled: list[tuple[float, float]] = []

    @property
    def compiled_s(self) -> float:
        """The time in which anything was traced or compiled."""
        covered, until = 0.0, float("-inf")
        for start, end in sorted(self._compiled):
            covered += max(end - max(start, until), 0.0)
            until = max(until, end)
        return covered

    @property
    def took_s(self) -> float:
        """The rest."""
        return self._whole_s - self.compiled_s

    @contextmanager
    def running(self) -> Iterator[None]:
        """Add the time of a context."""
        began = time.perf_counter()

        def listen(event: str, duration_secs: float, **_) -> None:
            if event.startswith(_COMPILING):
                now = time.perf_counter()
                self._compiled.append((max(now - duration_secs, began), now))

        jax.monitoring.register_event_duration_secs_listener(listen)
        try:
            yield
        finally:
            jax.monitoring.unregister_event_duration_listener(listen)
            self._whole_s += time.perf_counter() - began

    def each(self, items: Iterable[Item]) -> Iterator[Item]:
        """Add the time in which items are made, and not that of their use."""
        making = iter(items)
        while True:
            with self.running():
                try:
                    item = next(making)
                except StopIteration:
                    return
            yield item
