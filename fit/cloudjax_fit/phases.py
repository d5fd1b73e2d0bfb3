"""How long each phase of a fit takes."""

import time


class Phases:
    """`Phases` keep the wall time of one phase after the other."""

    def __init__(self):
        self._phases: dict[str, float] = {}
        self._started = self._last = time.perf_counter()

    def lap(self, phase: str) -> None:
        """Say that a phase has ended; its time is added to what it had before."""
        now = time.perf_counter()
        self._phases[phase] = self._phases.get(phase, 0.0) + now - self._last
        self._last = now

    @property
    def seconds(self) -> dict[str, float]:
        """Give the seconds by phase, and in all."""
        return {**self._phases, "total": self._last - self._started}
