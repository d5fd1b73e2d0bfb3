"""How well to render: by name, by the error wanted, by the time allowed, or by hand."""

import functools as ft
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import click


# What the first three options choose, and so may not be given beside them.
_BY_HAND = ("steps", "nodes")


class Share(click.ParamType):
    """A share, such as 2% or 0.02."""

    name = "share"

    def convert(self, value, param, ctx):
        if isinstance(value, float):
            return value
        try:
            number = float(value.removesuffix("%")) / (100 if "%" in value else 1)
        except ValueError:
            self.fail(f"{value!r} is not a share such as 2% or 0.02")
        if not 0 < number < 1:
            self.fail(f"{value!r} is not between 0 and 100 %")
        return number


_OPTIONS = (
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
        type=click.FloatRange(0, min_open=True),
        help="The best quality that takes no longer, compiling apart, as measured.",
    ),
    click.option("--nodes", type=int, help="Sub-pixel structures; 1 is quickest."),
    click.option(
        "--scattering/--no-scattering",
        default=True,
        help="Of thermal radiation by cloud; without, it absorbs alone.",
    ),
)


def quality_options(command):
    """All that says how well to render, but for --steps and --shadows."""
    return ft.reduce(lambda c, option: option(c), reversed(_OPTIONS), command)


@dataclass
class Choice:
    """A `Choice` is a quality, and what is expected of it; it tells what became of it.

    **Fields:** `expected_s`: seconds once compiled, None where nothing is known.
    """

    quality: Any
    expected_s: float | None = None
    _began: float = field(default_factory=time.perf_counter)

    def tell(self) -> None:
        """Say how long the work took, where a time was expected."""
        if self.expected_s is not None:
            took = time.perf_counter() - self._began
            click.echo(
                f"took {took:.3g} s with compiling, where {self.expected_s:.3g} s were "
                "expected without"
            )

    @classmethod
    def of(
        cls, options: Mapping[str, Any], standard: Any, kind: str, pixels: int
    ) -> "Choice":
        """Choose by the options, and say what was chosen and why.

        **Arguments:** `standard`: the quality where nothing is asked; `kind`: of scene;
        `pixels`: that see the Earth.

        **Raises:** `click.UsageError` for options that contradict each other;
        `DataError` where nothing measured is good or quick enough.
        """
        from cloudjax_scenes.quality import QUALITIES
        from cloudjax_scenes.trade.fronts import front_for

        name, error, seconds = (
            options[key] for key in ("quality", "max_error", "max_seconds")
        )
        asked = [key for key in ("quality", "max_error", "max_seconds") if options[key]]
        by_hand = [key for key in _BY_HAND if options[key] is not None]
        if len(asked + by_hand) > 1 and asked:
            first, second = (f"--{k.replace('_', '-')}" for k in (asked + by_hand)[:2])
            raise click.UsageError(f"{first} and {second} both choose: give one")
        shadows = options["shadows"]
        if not asked:
            given = {key: options[key] for key in by_hand}
            given |= {"scattering": options["scattering"], "shadows": shadows}
            return cls(replace(standard, **given))
        if name is not None:
            return cls(QUALITIES[name].with_shadows(shadows))
        front, source = front_for(kind)
        trial = (
            front.within_seconds(seconds, pixels)
            if error is None
            else front.within_error(error)
        )
        expected_s = front.expected_s(trial, pixels)
        click.echo(
            f"chosen: {trial.quality.words}, for an error of {trial.error:.2%} and "
            f"{expected_s:.3g} s once compiled (front: {source})"
        )
        return cls(trial.quality, expected_s)
