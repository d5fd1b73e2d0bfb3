"""What a fit says of the clouds themselves: their depth, thickness and water.

Radiances tell optical depth. Water follows from it by the particles' size, which bands
that they absorb in tell and which is assumed without these, and water per volume by the
thickness too, which the priors hold.
"""

from dataclasses import dataclass


# Of stratus in flight, g/m³: Table 2 of Schinder et al. (2024), after Miles et al.
# (2000, J. Atmos. Sci. 57, 295).
OBSERVED_WATER = {"low_stratus": (0.03, 2.9)}


@dataclass(frozen=True)
class FittedCloud:
    """A `FittedCloud` is what a fit says of one class of cloud, in physical terms.

    Depths are vertical, at 0.64 µm.

    **Fields:**

    - `effective_radius_um`: of the particles.
    - `physical_extinction_per_m`, `water_content_g_m3`: within cloud; water or ice.
    - `optical_depth`: lower quartile, median and upper quartile of the pixels in which
      the class is deeper than 0.3; NaN where it is nowhere.
    - `observed_water_g_m3`: the least and most that has been measured in such clouds;
      None where no range is given.
    """

    effective_radius_um: float
    physical_extinction_per_m: float
    water_content_g_m3: float
    optical_depth: tuple[float, float, float]
    observed_water_g_m3: tuple[float, float] | None

    @property
    def thickness_m(self) -> float:
        """Give the thickness of cloud of the median depth."""
        return self.optical_depth[1] / self.physical_extinction_per_m

    @property
    def water_path_g_m2(self) -> float:
        """Give the water path of the median depth."""
        return self.water_content_g_m3 * self.thickness_m

    @property
    def believable(self) -> bool:
        """Whether its water content has been observed."""
        if self.observed_water_g_m3 is None:
            return True
        least, most = self.observed_water_g_m3
        return least <= self.water_content_g_m3 <= most
