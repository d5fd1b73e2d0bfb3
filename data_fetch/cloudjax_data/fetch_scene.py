"""A date leads to a scene folder: the imagery of a scan and the weather around it."""

from dataclasses import dataclass
from pathlib import Path

from .fetch_gfs import plan_gfs
from .fetch_goes import GoesRequest, plan_goes
from .fetch_item import FetchItem
from .object_store import Link


@dataclass(frozen=True)
class ScenePlan:
    """A `ScenePlan` names the files of a scene folder; `notes` are sentences on what
    was left out.
    """

    items: tuple[FetchItem, ...]
    notes: tuple[str, ...] = ()


def plan_scene(
    request: GoesRequest, grid: str, link: Link, known: tuple[Path, ...] = ()
) -> ScenePlan:
    """Find the scan nearest to a time and the GFS around it; nothing is written.

    The arguments and errors are those of `plan_goes` and `plan_gfs`.
    """
    goes = plan_goes(request, link)
    middle = goes.start + (goes.end - goes.start) / 2
    gfs = plan_gfs(middle, grid, link, known)
    return ScenePlan((*goes.items, *gfs.items), (*goes.notes, *gfs.notes))
