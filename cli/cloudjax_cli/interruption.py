"""Ctrl-C that lets a fit end with the best so far."""

import signal
import threading
from collections.abc import Callable
from types import FrameType

import click


class Interruption:
    """An `Interruption` turns the first Ctrl-C into a wish that the solver asks for.

    Before the first step there is nothing to keep, and the second Ctrl-C is meant: both
    raise `KeyboardInterrupt` as always. So do all where signals cannot be caught, in
    other threads than the main one.
    """

    def __init__(self):
        self._stepped = self.wished = False
        self._before = None

    def __enter__(self) -> "Interruption":
        if threading.current_thread() is threading.main_thread():
            self._before = signal.signal(signal.SIGINT, self._on_signal)
        return self

    def __exit__(self, *_) -> None:
        if self._before is not None:
            signal.signal(signal.SIGINT, self._before)

    def __call__(self) -> bool:
        """Whether the fit is to end."""
        return self.wished

    def after(self, on_step: Callable[[int, float], None]):
        """Return what to call with each step: it calls `on_step` too."""

        def stepped(step: int, loss: float) -> None:
            self._stepped = True
            on_step(step, loss)

        return stepped

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        if self.wished or not self._stepped:
            raise KeyboardInterrupt
        self.wished = True
        click.echo("Ending with the best so far; Ctrl-C again ends at once.", err=True)
