"""Scenes and targets for fits, made by hand: small textures, few pixels, no files."""

from dataclasses import replace

import numpy as np

from cloudjax import Band, ClassTexture, CloudClass, Gaussian, Ladder, imagery_classes
from cloudjax_fit.histogram import quantiles
from cloudjax_fit.targets import BandStatistics, Target, block_of_pixels
from cloudjax_scenes import Imagery
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


def small_class(name: str = "low", hours: float = 0.0, **changes) -> CloudClass:
    """The low class of fits with one coarse texture."""
    texture = ClassTexture(Ladder(Gaussian(), 15e3, 7.5e3), 1.0, 0.5, hours)
    return replace(
        imagery_classes()["low_stratus"], name=name, textures=(texture,), **changes
    )


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
        "backgrounds": {n: sea[n] for n in bands},
    }
    return Imagery(**(given | changes))


def small_target(
    imagery: Imagery, images: dict[int, np.ndarray], cloud: np.ndarray
) -> Target:
    """The target of images, with statistics that are counted pixel by pixel."""
    block = block_of_pixels(SHAPE, BLOCKS)
    statistics = {}
    for number, image in images.items():
        chosen, where = image.reshape(-1)[cloud.reshape(-1)], block[cloud.reshape(-1)]
        low, high = 0.5 * chosen.min(), 1.2 * chosen.max()
        edges = np.linspace(low, high, 17)
        counts = [np.histogram(chosen[where == b], edges)[0] for b in range(16)]
        statistics[number] = BandStatistics(
            quantiles(chosen.astype(float)), float(low), float(high), np.array(counts)
        )
    return Target(
        imagery,
        statistics,
        BLOCKS,
        np.bincount(block[cloud.reshape(-1)], minlength=16),
        np.bincount(block, minlength=16),
    )


def flecked(seed: int = 0) -> tuple[dict[int, np.ndarray], np.ndarray]:
    """Images of bands 1 and 13 with bright, cold blocks of cloud, and where it is."""
    rng = np.random.default_rng(seed)
    cover = np.kron(rng.uniform(0.2, 0.9, BLOCKS), np.ones((6, 6)))
    cloud = rng.random(SHAPE) < cover
    thick = np.kron(rng.uniform(0.3, 0.9, BLOCKS), np.ones((6, 6)))
    kappa0 = BANDS[1].coefficients(EARTH_SUN_DISTANCE_AU)["kappa0"]
    bright = np.where(cloud, thick + 0.03 * rng.standard_normal(SHAPE), 0.05)
    kelvin = np.where(cloud, 289 - 20 * thick + rng.standard_normal(SHAPE), 289.0)
    return {1: bright / kappa0, 13: default_calibration(13).radiance(kelvin)}, cloud
