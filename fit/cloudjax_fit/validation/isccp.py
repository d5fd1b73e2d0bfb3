"""The nine boxes of ISCCP: how much cloud has which optical depth and top pressure."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float


Pixels = Float[np.ndarray, " pixels"]
# Edges of the boxes: optical depth, and pressure at the top [hPa], from above.
DEPTHS = (0.3, 3.6, 23.0, np.inf)
TOPS_HPA = (0.0, 440.0, 680.0, np.inf)
TYPES = (
    ("cirrus", "cirrostratus", "deep convection"),
    ("altocumulus", "altostratus", "nimbostratus"),
    ("cumulus", "stratocumulus", "stratus"),
)
# Finer ones, of ISCCP's joint histograms; the outermost go on beyond.
FINE_DEPTHS = (0.3, 1.3, 3.6, 9.4, 23.0, 60.0, 379.0)
FINE_TOPS_HPA = (50.0, 180.0, 310.0, 440.0, 560.0, 680.0, 800.0, 1000.0)
# Global annual means [per cent], from memory and to whole points: they have not been
# looked up in the paper.
CLIMATOLOGY = ((13.0, 6.0, 3.0), (10.0, 8.0, 2.0), (13.0, 12.0, 2.0))
CLIMATOLOGY_WORDS = (
    "Global annual means as Rossow & Schiffer (1999, Bull. Amer. Meteor. Soc. 80, "
    "2261) have them, cited from memory and to whole points: not checked against the "
    "paper."
)
# Less than this of a pixel is no cloud with a depth of its own.
_LEAST_FRACTION = 0.05


@dataclass(frozen=True, eq=False)
class CloudTypes:
    """`CloudTypes` are amounts of cloud by optical depth and top pressure, in per cent
    of the area.

    **Fields:**

    - `boxes`: rows from high to low tops, columns from thin to thick, as `TYPES`.
    - `fine`: the same in the finer intervals of ISCCP.
    - `thin`: of cloud that is thinner than 0.3 in the mean of its part of the pixel.
    """

    boxes: Float[np.ndarray, "3 3"]
    fine: Float[np.ndarray, "tops depths"]
    thin: float

    def rows(self) -> list[tuple[str, float, float]]:
        """Return name, amount here and in the climatology of each type."""
        return [
            (TYPES[i][j], float(self.boxes[i, j]), CLIMATOLOGY[i][j])
            for i in range(3)
            for j in range(3)
        ]

    def numbers(self) -> dict[str, Any]:
        """Return all of it as plain data."""
        return {
            "percent": {name: amount for name, amount, _ in self.rows()},
            "climatology_percent": {name: of for name, _, of in self.rows()},
            "climatology": CLIMATOLOGY_WORDS,
            "thinner_than_0.3_percent": self.thin,
            "joint_percent": self.fine.tolist(),
            "joint_optical_depth_edges": list(FINE_DEPTHS),
            "joint_top_hpa_edges": list(FINE_TOPS_HPA),
        }


def cloud_types(
    fraction: Pixels, optical_depth: Pixels, top_hpa: Pixels, area_m2: Pixels
) -> CloudTypes:
    """Sort the cloud of pixels into boxes: each pixel's fraction, by the optical depth
    of the part that is cloudy.

    **Arguments:** `optical_depth`: mean over the whole pixel, from straight above.
    """
    cloudy = (fraction >= _LEAST_FRACTION) & np.isfinite(top_hpa)
    depth = optical_depth[cloudy] / fraction[cloudy]
    amount = 100 * (fraction * area_m2)[cloudy] / area_m2.sum()
    top = top_hpa[cloudy]

    def joint(tops, depths):
        return np.histogram2d(top, depth, [tops, depths], weights=amount)[0]

    fine_tops = (0.0, *FINE_TOPS_HPA[1:-1], np.inf)
    return CloudTypes(
        boxes=joint(TOPS_HPA, DEPTHS),
        fine=joint(fine_tops, (*FINE_DEPTHS[:-1], np.inf)),
        thin=float(amount[depth < DEPTHS[0]].sum()),
    )
