"""What the parts of a scene's model cost, in words."""

from collections.abc import Iterator

from cloudjax_scenes.quality import Quality
from cloudjax_scenes.scene_cost import Cost, Part, costs
from cloudjax_scenes.trade.subjects import some_of
from cloudjax_scenes.trade.trial import Subject


Row = tuple[str, str]
# Pixels: a tile that every machine's cache holds.
_TIMED = 2048


def cost_rows(subject: Subject, *, shadows: int, budget_s: float) -> Iterator[Row]:
    """Tell of each part of the model whether it is used, why, and what it costs."""
    found = costs(
        subject.scene(Quality(shadows=shadows)),
        some_of(subject.rays, _TIMED),
        subject.sun_direction,
        pixels=subject.outline.pixels,
        budget_s=budget_s,
    )
    for part, cost in found:
        yield part.name, f"{_said(part, cost)}: {part.why}"


def _said(part: Part, cost: Cost) -> str:
    if not part.used:
        return "left out, costs nothing"
    if cost.seconds is None:
        return (
            "used" if part.without is None else "used, not measured in the time given"
        )
    return f"{cost.seconds:.2f} s" if cost.timed else f"about {cost.seconds:.1f} s"
