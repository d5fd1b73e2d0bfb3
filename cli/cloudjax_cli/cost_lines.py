"""What the parts of a scene's model cost, in words."""

from collections.abc import Iterator

from cloudjax_scenes.quality import Quality
from cloudjax_scenes.scene_cost import Cost, Part, costs
from cloudjax_scenes.trade.subjects import some_of
from cloudjax_scenes.trade.trial import Subject


# Pixels: a tile that every machine's cache holds.
_TIMED = 2048
_LINE = "{:<26}{:<6}{:>12}   {}"


def cost_lines(subject: Subject, *, shadows: int, budget_s: float) -> Iterator[str]:
    """Tell of each part of the model whether it is used, what it costs, and why."""
    yield _LINE.format("part", "used", "seconds", "why")
    found = costs(
        subject.scene(Quality(shadows=shadows)),
        some_of(subject.rays, _TIMED),
        subject.sun_direction,
        pixels=subject.outline.pixels,
        budget_s=budget_s,
    )
    for part, cost in found:
        used = "yes" if part.used else "no"
        yield _LINE.format(part.name, used, _seconds(part, cost), part.why)


def _seconds(part: Part, cost: Cost) -> str:
    if not part.used:
        return "0"
    if cost.seconds is None:
        return "in others" if part.without is None else "not timed"
    return f"{cost.seconds:.2f}" if cost.timed else f"about {cost.seconds:.1f}"
