"""Where fits of a class of cloud start, and how far the priors let them go.

Histograms tell optical depth: extinction times thickness. What makes water of it is how
thick clouds are, which must be known beforehand (docs/theory/light.md).
"""

from dataclasses import dataclass

from cloudjax import Shell


@dataclass(frozen=True)
class Start:
    """The middle of a class's priors, and the width of some.

    **Fields:**

    - `shell`: the air that the class is looked for in.
    - `base_m`, `top_m`, `barrier_scale_m`: of the condensation barriers.
    - `extinction_per_m`: physical, at 0.64 µm.
    - `top_bounds_m`: between which the top stays.
    - `threshold`: with that of minus the least of both barriers, clouds cover what the
      mask says.
    - `top_spread_m`: standard deviation of the prior of the top; `scale_spread`,
      `extinction_spread`, `infrared_spread`: of the logarithms of the barriers' scale,
      of extinction, and of infrared absorption over it, of which `infrared_least` is
      the lower bound.
    """

    shell: Shell
    base_m: float
    top_m: float
    barrier_scale_m: float
    extinction_per_m: float
    top_bounds_m: tuple[float, float]
    threshold: float = 0.0
    top_spread_m: float = 1000.0
    scale_spread: float = 0.7
    extinction_spread: float = 1.0
    infrared_spread: float = 0.7
    infrared_least: float = 0.3


# A scene's own imagery tells low cloud from high cloud and no more, so the high class
# takes all the air between the low shell and the standard tropopause: with the 6.5 to
# 10 km of the paper's cirrus, the fitted scene had neither its mid-level cloud nor its
# coldest tops (docs/decisions.md).
START = {
    "low_stratus": Start(
        Shell(500.0, 4000.0), 600.0, 1800.0, 250.0, 0.04, (800.0, 4500.0)
    ),
    "cirrus": Start(
        Shell(4000.0, 11000.0), 5000.0, 9000.0, 500.0, 0.0053, (4300.0, 11500.0)
    ),
}
# Marine stratocumulus is 200 to 400 m thick, of 0.2 to 0.6 g/m³ (docs/theory/light.md
# has the sources). From altostratus to cirrus, tops rise with depth. Absorption in the
# infrared is known for a size: 9 to 12 µm of droplets, 20 to 60 of crystals change it
# by 10 %.
PUBLISHED = {
    "low_stratus": Start(
        Shell(300.0, 2500.0), 600.0, 700.0, 100.0, 0.04, (400.0, 2500.0), -1.2,
        top_spread_m=200.0, scale_spread=0.5, extinction_spread=0.5,
        infrared_spread=0.1, infrared_least=0.1,
    ),
    "cirrus": Start(
        Shell(4000.0, 11000.0), 5000.0, 4800.0, 1500.0, 0.003, (4100.0, 11500.0), -2.1,
        extinction_spread=0.7, infrared_spread=0.1, infrared_least=0.1,
    ),
}  # fmt: skip
