"""How well to fit: by name, by the error wanted, or by the time allowed."""

import functools as ft
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

from .options import Duration
from .quality_options import Share


if TYPE_CHECKING:
    from cloudjax_fit.fit_settings import FitSettings
    from cloudjax_fit.targets import Target
    from cloudjax_fit.trade.fronts import ExpectedFit
    from cloudjax_scenes.trade.stopwatch import Stopwatch


_OPTIONS = (
    click.option(
        "--quality",
        type=click.Choice(["draft", "standard", "reference"]),
        help="In place of --rays and --steps.",
    ),
    click.option(
        "--max-error",
        # Parameters may move by some deviations; 50 is likely to mean 50 %.
        type=Share(below=10.0),
        help="The quickest rays and steps that put the parameters off by no more than "
        "this share of their standard deviation, as measured (cloudjax tradeoff "
        "--fit).",
    ),
    click.option(
        "--max-seconds",
        type=Duration(),
        help="The best rays and steps that take no longer, compiling apart, as "
        "measured.",
    ),
)


def fit_quality_options(command):
    """All that says how well to fit, besides --rays and --steps."""
    return ft.reduce(lambda c, option: option(c), reversed(_OPTIONS), command)


@dataclass(frozen=True)
class AskedFit:
    """An `AskedFit` is what a user asks of a fit that a front must choose for.

    **Fields:** as the options; None where nothing is asked.
    """

    max_error: float | None = None
    max_seconds: float | None = None

    @staticmethod
    def of(options: Mapping[str, Any]) -> "AskedFit":
        """Take what is asked out of the options of a command.

        **Raises:** `click.UsageError` where something else chooses, too.
        """
        asked = AskedFit(options["max_error"], options["max_seconds"])
        ways = ("max_error", "max_seconds", "quality", "rays", "steps")
        given = [name for name in ways if options[name] is not None]
        if asked.by_front and len(given) > 1:
            first, second = (f"--{name.replace('_', '-')}" for name in given[:2])
            raise click.UsageError(f"{first} and {second} both choose: give one")
        return asked

    @property
    def by_front(self) -> bool:
        """Whether what has been measured must choose."""
        return self.max_error is not None or self.max_seconds is not None

    def require_front(self, settings: "FitSettings") -> None:
        """Make sure that there is a front to choose from, if one is needed.

        **Raises:** `DataError` where there is none.
        """
        from cloudjax_fit.trade.fronts import front_for
        from cloudjax_fit.trade.outline import FitKind

        if self.by_front:
            front_for(FitKind.of(settings))

    def by_measure(
        self, target: "Target", settings: "FitSettings", tell: Callable[[str], None]
    ) -> "ExpectedFit":
        """Choose from the front for a scene, and say what and why.

        **Raises:** `DataError` where nothing measured is good or quick enough.
        """
        from cloudjax_fit.trade.fronts import front_for
        from cloudjax_fit.trade.outline import FitOutline

        outline = FitOutline.of(target, settings)
        front, source = front_for(outline.kind)
        if self.max_error is not None:
            found = front.within_error(self.max_error, outline)
        else:
            assert self.max_seconds is not None
            found = front.within_seconds(self.max_seconds, outline)
        tell(
            f"chosen: {found.quality.words}, for parameters off by {found.error:.0%} "
            f"of a standard deviation and {found.seconds:.3g} s to fit once compiled "
            f"(front: {source})"
        )
        return found


def told_time(expected: "ExpectedFit", watch: "Stopwatch") -> str:
    """Say how long a fit took that was chosen by what was expected of it."""
    return (
        f"fitted in {watch.took_s:.3g} s, where {expected.seconds:.3g} s were "
        f"expected, and compiled in {watch.compiled_s:.3g} s"
    )
