"""What a fit may move of a class of cloud, between which bounds, by which prior."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Prior:
    """A `Prior` says how far a parameter may go from its default, and how likely that
    is.

    **Fields:**

    - `lower`, `upper`: bounds, in the parameter's unit.
    - `spread`: standard deviation around the default, of the logarithm where `log`.
    - `log`: whether scale and prior are logarithmic.
    - `free`: whether a fit may move the parameter.
    """

    lower: float
    upper: float
    spread: float
    log: bool = False
    free: bool = True

    def __post_init__(self):
        if not self.lower < self.upper:
            raise ValueError("lower must be less than upper.")
        if not self.spread > 0:
            raise ValueError("spread must be positive.")
        if self.log and not self.lower > 0:
            raise ValueError("lower must be positive where the prior is logarithmic.")


@dataclass(frozen=True)
class ClassParameter:
    """A `ClassParameter` is a number of a class of cloud that a fit may move, in
    physical terms.

    **Fields:**

    - `name`: short, such as "top"; `key`: in a file of classes, such as "top_m".
    - `path`: where it sits in the class's layer, such as "cloud.function.top_m".
    - `default`: its value in the class, where fits start.
    - `prior`: its bounds and its prior; `unit`: of all these.
    """

    name: str
    key: str
    path: str
    default: float
    prior: Prior
    unit: str = ""


# Where a file of classes says nothing. Extinction and absorption at visible and
# infrared wavelengths are known to a factor; a fit moves a top within its shell.
USUAL = {
    "weight": Prior(0.0, 3.0, 0.4),
    "mask_gain": Prior(0.0, 4.0, 0.4),
    "threshold": Prior(-4.0, 4.0, 0.7),
    "barrier_scale_m": Prior(30.0, 2500.0, 0.7, log=True),
    "extinction_per_m": Prior(1e-6, 1.0, 0.7, log=True),
    "infrared_ratio": Prior(0.1, 60.0, 0.1, log=True),
    "extinction_growth": Prior(-0.5, 2.0, 0.3),
    "depth_response": Prior(0.0, 3.0, 0.3),
    "top_response": Prior(0.3, 2.0, 0.3),
    "roughness_response": Prior(0.0, 3.0, 0.3),
}
ALTITUDE_SPREAD_M = 1000.0
# By phase, µm: the radii that Collection 6 of MODIS retrieves (Platnick et al. 2017,
# IEEE Trans. Geosci. Remote Sens. 55, 502: 4 to 30 of droplets, 5 to 60 of crystals),
# as far as the table of optics goes.
RADII = {
    "water": Prior(4.0, 30.0, 0.3, log=True),
    "ice": Prior(10.0, 60.0, 0.3, log=True),
}
# Places in a layer and units by key, in the order in which fits list them.
PLACES = {
    "mask_gain": ("cloud.function.mask_gain", ""),
    "threshold": ("cloud.function.threshold", ""),
    "base_m": ("cloud.function.base_m", "m"),
    "top_m": ("cloud.function.top_m", "m"),
    "barrier_scale_m": ("cloud.function.barrier_scale_m", "m"),
    "extinction_per_m": ("extinction_per_m", "1/m"),
    "effective_radius_um": ("optics.particles.effective_radius_um", "µm"),
    "infrared_ratio": ("optics.infrared_ratio", ""),
    "extinction_growth": ("cloud.extinction_growth", ""),
    "depth_response": ("cloud.response.depth", ""),
    "top_response": ("cloud.response.top", ""),
    "roughness_response": ("cloud.response.roughness", ""),
}
# What is fitted where its prior is given only: radiances seen from above hardly tell a
# condensation barrier's foot, the light of the paper knows no denser cloud, and the
# particles know what they absorb in the infrared.
UNLESS_ASKED = ("base_m", "extinction_growth", "infrared_ratio")
# By day these bands tell the size of particles, which absorb there (Nakajima & King
# 1990, J. Atmos. Sci. 47, 1878): 1.6, 2.2 and 3.9 µm.
SIZE_BANDS = (5, 6, 7)
# How clouds follow the coarse fields of imagery: fitted where there are any.
RESPONSES = ("depth_response", "top_response", "roughness_response")
WEIGHT = "weight_"
# Fitted where their priors are given only.
PERSISTENCE = "persistence_"


def short_name(key: str) -> str:
    """Return the name without its unit: "top" of "top_m", "radius" of the particles."""
    name = key.removesuffix("_per_m").removesuffix("_m").removesuffix("_um")
    return name.removeprefix("effective_")
