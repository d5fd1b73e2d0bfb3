"""What a reader of a fit should mind before believing it, in sentences."""

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Bool, Float

from .targets import Target
from .uncertainty import Estimate


# Of the pixels that see the Earth.
MISSING_SHARE = 0.05
# Values that differ by less than this part of them tell no clouds apart.
ALIKE = 1e-3
# A cloud that is nowhere thicker takes 3 % of the light that comes from below.
LEAST_DEPTH = 0.03


def cautions(
    target: Target,
    estimates: Sequence[Estimate],
    depths: Mapping[str, Float[np.ndarray, "y x"]],
    earth: Bool[np.ndarray, "y x"],
) -> list[str]:
    """Return sentences about parameters at bounds, absent classes of cloud, bands that
    tell nothing, missing data, and what had to be assumed of the scene.

    **Arguments:**

    - `depths`: vertical optical depths in the fitted image, by class of cloud.
    - `earth`: pixels that see the Earth.
    """
    said = []
    bound = [estimate.parameter.name for estimate in estimates if estimate.at_bound]
    if bound:
        said.append(f"Bounds, and not the data, hold {', '.join(bound)}.")
    for name, depth in depths.items():
        if depth.max() < LEAST_DEPTH:
            said.append(f"The fitted image has no {name}: its parameters mean nothing.")
    for number, table in target.quantiles.items():
        if np.ptp(table.values) <= ALIKE * np.abs(table.values).max():
            said.append(
                f"Band {number} is the same in all cloud pixels, saturated or blind to "
                "them: it tells nothing."
            )
    missing = missing_share(target, earth)
    if missing > MISSING_SHARE:
        said.append(f"{missing:.0%} of the pixels that see the Earth have no data.")
    return said + list(target.imagery.notes)


def missing_share(target: Target, earth: Bool[np.ndarray, "y x"]) -> float:
    """Return the share of the pixels that see the Earth, `earth`, that has no data."""
    return float(1 - target.block_valid.sum() / max(earth.sum(), 1))
