"""How well to render: by name, by the error wanted, by the time allowed, or by hand."""

import functools as ft
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import click

from .options import Duration


if TYPE_CHECKING:
    from cloudjax_scenes.quality import Quality
    from cloudjax_scenes.trade.outline import Outline
    from cloudjax_scenes.trade.stopwatch import Stopwatch


class Share(click.ParamType):
    """A share, such as 2% or 0.02, of less than a whole or than some."""

    name = "share"

    def __init__(self, below: float = 1.0):
        self._below = below

    def convert(self, value, param, ctx):
        if isinstance(value, float):
            return value
        try:
            number = float(value.removesuffix("%")) / (100 if "%" in value else 1)
        except ValueError:
            self.fail(f"{value!r} is not a share such as 2% or 0.02")
        if not 0 < number < self._below:
            self.fail(f"{value!r} is not between 0 and {100 * self._below:.0f} %")
        return number


_OPTIONS = (
    click.option(
        "--steps",
        type=click.IntRange(1),
        help="Through each cloud shell; over weather, through the deepest.",
    ),
    click.option(
        "--nodes", type=click.IntRange(1), help="Sub-pixel structures; 1 is quickest."
    ),
    click.option(
        "--scattering/--no-scattering",
        default=True,
        help="Of thermal radiation by cloud; without, it absorbs alone.",
    ),
    click.option(
        "--shadows",
        type=click.IntRange(0),
        default=0,
        help="Steps towards the sun, with physical light; 6 are good, 0 is none.",
    ),
    click.option(
        "--quality",
        type=click.Choice(["draft", "standard", "reference"]),
        help="In place of --steps and --nodes.",
    ),
    click.option(
        "--max-error",
        type=Share(),
        help="The quickest quality whose radiances err by no more than this share of "
        "their standard deviation, as measured (cloudjax tradeoff).",
    ),
    click.option(
        "--max-seconds",
        type=Duration(),
        help="The best quality that takes no longer, compiling apart, as measured.",
    ),
)


def quality_options(command):
    """All that says how well to render, by the names of `AskedQuality`."""
    return ft.reduce(lambda c, option: option(c), reversed(_OPTIONS), command)


@dataclass(frozen=True)
class AskedQuality:
    """An `AskedQuality` is what a user asks of quality, in one way or another.

    **Fields:** as the options; None where nothing is asked.

    **Raises:** `click.UsageError` for two ways at once.
    """

    steps: int | None = None
    nodes: int | None = None
    scattering: bool = True
    shadows: int = 0
    quality: str | None = None
    max_error: float | None = None
    max_seconds: float | None = None

    def __post_init__(self):
        ways = ("quality", "max_error", "max_seconds")
        asked = [name for name in ways if getattr(self, name) is not None]
        by_hand = [name for name in ("steps", "nodes") if getattr(self, name)]
        both = asked + by_hand
        if asked and len(both) > 1:
            first, second = (f"--{name.replace('_', '-')}" for name in both[:2])
            raise click.UsageError(f"{first} and {second} both choose: give one")

    @staticmethod
    def of(options: Mapping[str, Any]) -> "AskedQuality":
        """Take what is asked out of the options of a command."""
        names = AskedQuality.__dataclass_fields__
        return AskedQuality(**{name: options[name] for name in names})

    @property
    def by_front(self) -> bool:
        """Whether what has been measured must choose."""
        return self.max_error is not None or self.max_seconds is not None

    def by_hand(self, standard: "Quality") -> "Quality":
        """Return the quality that is asked without a front.

        **Arguments:** `standard`: where nothing is asked.
        """
        from cloudjax_scenes.quality import QUALITIES

        if self.quality is not None:
            return QUALITIES[self.quality].with_shadows(self.shadows)
        given = {"steps": self.steps, "nodes": self.nodes}
        known = {name: value for name, value in given.items() if value is not None}
        return replace(
            standard, **known, scattering=self.scattering, shadows=self.shadows
        )

    def by_measure(self, outline: "Outline") -> "Choice":
        """Choose from the front for a scene, and say what and why.

        **Raises:** `DataError` where nothing measured is good or quick enough.
        """
        from cloudjax_scenes.trade.fronts import front_for

        front, source = front_for(outline.kind)
        if self.max_error is not None:
            found = front.within_error(self.max_error, outline)
        else:
            assert self.max_seconds is not None
            found = front.within_seconds(self.max_seconds, outline)
        click.echo(
            f"chosen: {found.quality.words}, for an error of {found.error:.2%} and "
            f"{found.seconds:.3g} s to render once compiled (front: {source})"
        )
        return Choice(found.quality, found.seconds)


@dataclass(frozen=True)
class Choice:
    """A `Choice` is a quality, and the seconds expected of it once compiled."""

    quality: "Quality"
    expected_s: float

    def tell(self, watch: "Stopwatch") -> None:
        """Say how long the render took."""
        click.echo(
            f"rendered in {watch.took_s:.3g} s, where {self.expected_s:.3g} s were "
            f"expected, and compiled in {watch.compiled_s:.3g} s"
        )
