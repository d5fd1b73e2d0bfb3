"""What cloud particles do to light in the ABI bands, at one particle size per phase.

Water droplets of effective radius 10 µm by Hu & Stamnes (1993, J. Climate 6, 728), ice
crystals of generalised effective size 60 µm by Fu (1996, J. Climate 9, 2058) and Fu et
al. (1998, J. Climate 11, 2223), at the bands' central wavelengths. The table is printed
by tools/make_optics.py.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True)
class Particles:
    """Cloud particles of one phase and size.

    **Fields:**

    - `co_albedo`: 1 - ω, for the reflective bands 1 to 6.
    - `relative_absorption`: over that at 10.35 µm (band 13), for bands 7 to 16.
    - `infrared_ratio`: absorption at 10.35 µm over extinction at 0.64 µm.
    """

    co_albedo: tuple[float, ...]
    relative_absorption: tuple[float, ...]
    infrared_ratio: float

    def co_albedo_in(self, bands: Sequence[int]) -> Float[np.ndarray, " bands"]:
        return np.array([self.co_albedo[band - 1] for band in bands])

    def relative_absorption_in(
        self, bands: Sequence[int]
    ) -> Float[np.ndarray, " bands"]:
        return np.array([self.relative_absorption[band - 7] for band in bands])


WATER = Particles(
    co_albedo=(3.16e-07, 2.56e-06, 5.21e-05, 0.00404, 0.00789, 0.0348),
    relative_absorption=(
        0.323, 1.560, 1.076, 0.977, 0.935, 1.013, 1.000, 1.189, 1.403, 1.533,
    ),
    infrared_ratio=0.367,
)  # fmt: skip
ICE = Particles(
    co_albedo=(2.16e-06, 1.13e-05, 2.06e-04, 0.0400, 0.0902, 0.0614),
    relative_absorption=(
        0.845, 1.042, 1.025, 1.011, 0.976, 0.965, 1.000, 1.074, 1.117, 1.127,
    ),
    infrared_ratio=0.465,
)  # fmt: skip
