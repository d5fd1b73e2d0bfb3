"""Scenes and targets for fits, made by hand: small textures, few pixels, no files."""

from dataclasses import replace

import numpy as np

from cloudjax import (
    Band,
    ClassTexture,
    CloudClass,
    Gaussian,
    Ladder,
    LatLonGrid,
    imagery_classes,
)
from cloudjax.clouds.class_parameters import Prior
from cloudjax.clouds.classes import ImageryRule
from cloudjax_fit.observation import target_of
from cloudjax_fit.targets import Target
from cloudjax_scenes import Imagery
from cloudjax_scenes.background import Background
from cloudjax_scenes.cloud_rule import CloudRule
from tests.generated import (
    EARTH_SUN_DISTANCE_AU,
    SCAN_START,
    default_calibration,
    window,
)
from tests.helpers import PLANCK, SOLAR


SHAPE = (24, 24)
BLOCKS = (4, 4)
BANDS = {1: Band(1, 0.47, SOLAR[1]), 13: Band(13, 10.33, None, PLANCK[13])}
RULE = CloudRule(1, 0.25, 13, 270.0)
# The fewer parameters are free, the sooner a fit is compiled.
HELD = {
    name: {"free": False}
    for name in (
        "low.mask_gain",
        "low.infrared_ratio",
        "low.barrier_scale",
        "low.top",
        "air.path_C01",
        "air.temperature_offset",
        "air.gain_C13",
    )
}


class Killed(Exception):
    """In place of a signal that no program can catch."""


def killed_at(count: int):
    """Return what to call with each step, of which so many are allowed."""
    steps = []

    def on_step(step, loss):
        steps.append(step)
        if len(steps) > count:
            raise Killed

    return on_step


def small_class(name: str = "low", hours: float = 0.0, **changes) -> CloudClass:
    """A low class with one coarse texture, whose extinction is alike everywhere."""
    texture = ClassTexture(Ladder(Gaussian(), 15e3, 7.5e3), 1.0, 0.5, hours)
    usual = imagery_classes()["low_stratus"]
    given = {
        "name": name,
        "textures": (texture,),
        "threshold": -1.2,
        "extinction_growth": 0.0,
        "conditions": replace(
            usual.conditions, shell_bottom_m=300.0, shell_top_m=2500.0
        ),
        "imagery": ImageryRule(warmer_than_standard_at_m=4000.0, altitude_m=2250.0),
        "priors": {
            "top_m": Prior(400.0, 2500.0, 200.0),
            "barrier_scale_m": Prior(30.0, 2500.0, 0.5, log=True),
            "extinction_per_m": Prior(1e-6, 1.0, 0.5, log=True),
            "infrared_ratio": Prior(0.1, 60.0, 0.1, log=True),
        },
    }
    return replace(usual, **(given | changes))


def full_slab(depth: float, **changes) -> CloudClass:
    """A class that covers all, of about 1.1 km and this physical optical depth.

    Its barriers open within 30 m, where eq. (1) is some 60 times its textures above
    zero: 1 km between base and top, and h ln 60 at either end.
    """
    h = 10.0
    thickness_m = 1000 + 2 * h * np.log(60.0)
    return small_class(
        threshold=-60.0,
        base_m=1000.0,
        top_m=2000.0,
        barrier_scale_m=h,
        extinction_per_m=depth / thickness_m,
        priors={},
        **changes,
    )


def small_imagery(
    fraction: float = 0.6,
    *,
    names: tuple[str, ...] = ("low",),
    west_deg: float = 0.0,
    bands: tuple[int, ...] = (1, 13),
    **changes,
) -> Imagery:
    """Uniform cover over a dark sea of 289 K, off California, seen from GOES-17.

    **Arguments:** `west_deg`: moves satellite and all westward around the Earth.
    """
    grid = window(SHAPE, subsatellite_longitude_deg=-137.0 - west_deg)
    ground, _ = grid.rays().ground()
    axes = [
        np.linspace(at.min() - 1, at.max() + 1, 8)
        for at in (ground.latitude_deg, ground.longitude_deg)
    ]
    kappa0 = BANDS[1].coefficients(EARTH_SUN_DISTANCE_AU)["kappa0"]
    sea = {
        1: np.full((8, 8), 0.05 / kappa0),
        13: default_calibration(13).radiance(np.full((8, 8), 289.0)),
    }
    given = {
        "name": "small",
        "platform": "G17",
        "time": SCAN_START,
        "grid": grid,
        "rule": RULE,
        "bands": {n: BANDS[n] for n in bands},
        "earth_sun_distance_au": EARTH_SUN_DISTANCE_AU,
        "latitude_deg": axes[0],
        "longitude_deg": axes[1],
        "fractions": {name: np.full((8, 8), fraction) for name in names},
        "background": Background(
            LatLonGrid.from_axes(*axes), {n: sea[n] for n in bands}
        ),
    }
    return Imagery(**(given | changes))


def small_target(imagery: Imagery, images: dict[int, np.ndarray]) -> Target:
    """The target of images all of whose pixels are good."""
    return target_of(imagery, images, np.ones(SHAPE, bool), BLOCKS)


def flecked(seed: int = 0) -> dict[int, np.ndarray]:
    """Images of bands 1 and 13 with bright, cold blocks of cloud."""
    rng = np.random.default_rng(seed)
    cover = np.kron(rng.uniform(0.2, 0.9, BLOCKS), np.ones((6, 6)))
    cloud = rng.random(SHAPE) < cover
    thick = np.kron(rng.uniform(0.3, 0.9, BLOCKS), np.ones((6, 6)))
    kappa0 = BANDS[1].coefficients(EARTH_SUN_DISTANCE_AU)["kappa0"]
    bright = np.where(cloud, thick + 0.03 * rng.standard_normal(SHAPE), 0.05)
    kelvin = np.where(cloud, 289 - 20 * thick + rng.standard_normal(SHAPE), 289.0)
    return {1: bright / kappa0, 13: default_calibration(13).radiance(kelvin)}
