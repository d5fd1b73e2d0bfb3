"""What became of one scene of many."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from .fit_result import CONVERGED, INTERRUPTED, NOT_CONVERGED
from .joint_fitting import TestedScene


# How a scene may end besides.
RENDERED, FAILED, FAULT = "rendered", "failed", "fault of the program"
# Seen with what a joint fit has found for other scenes.
TESTED = "tested"
NOT_DONE = "not done"
GOOD = CONVERGED, RENDERED, TESTED
STATES = (*GOOD, NOT_CONVERGED, INTERRUPTED, FAILED, FAULT, NOT_DONE)


@dataclass(frozen=True)
class Outcome:
    """An `Outcome` is what became of one scene.

    **Fields:**

    - `name`: of the scene; `state`: one of `STATES`.
    - `reason`: for the state, in one sentence.
    - `seconds`: of wall time.
    - `observed_cloud`, `simulated_cloud`: share of the pixels that counts as cloud.
    - `w1_over_std`: the distance of each band by its number.
    - `page`: to see more, a path from the folder of the summary; empty for none.
    - `kept`: nothing was to be done, for an earlier run has done it.
    """

    name: str
    state: str
    reason: str
    seconds: float = math.nan
    observed_cloud: float = math.nan
    simulated_cloud: float = math.nan
    w1_over_std: Mapping[int, float] = field(default_factory=dict)
    page: str = ""
    kept: bool = False


def outcome_of_fit(
    name: str, numbers: Mapping[str, Any], *, page: str = "", kept: bool = False
) -> Outcome:
    """Return what the `fit.json` of a scene tells."""
    clouds = numbers["cloud_fraction"]
    return Outcome(
        name,
        numbers["status"],
        numbers["message"],
        _number(numbers["seconds"]["total"]),
        _number(clouds["observed"]),
        _number(clouds["simulated"]),
        {int(n): _number(b["w1_fit_over_std"]) for n, b in numbers["bands"].items()},
        page,
        kept,
    )


def outcome_of_test(name: str, test: TestedScene) -> Outcome:
    """Return what is told of a scene that was not fitted."""
    defaults = ", ".join(
        f"C{n:02d} {d.w1_over_std:.3g}" for n, d in test.distances_start.items()
    )
    clouds = test.cloud_fractions
    return Outcome(
        name,
        TESTED,
        f"not fitted; with the defaults W1 over std is {defaults}",
        observed_cloud=clouds["observed"],
        simulated_cloud=clouds["simulated"],
        w1_over_std={n: d.w1_over_std for n, d in test.distances_fit.items()},
    )


def _number(value: float | None) -> float:
    return math.nan if value is None else value
