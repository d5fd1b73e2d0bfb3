"""What every peer is given: plain numpy, so that none brings the tools of another."""

from dataclasses import dataclass

import numpy as np


EQUATOR_M, POLE_M = 6378137.0, 6356752.31414
SEA_LEVEL_K, LAPSE_K_PER_M, TROPOPAUSE_K = 288.15, 6.5e-3, 216.65
ECCENTRICITY2 = 1 - (POLE_M / EQUATOR_M) ** 2


@dataclass(frozen=True, eq=False)
class Mask:
    """A weather mask on a grid round the Earth.

    **Fields:** `values`: [lat, lon]. `first_deg`, `step_deg`: latitude and longitude.
    """

    values: np.ndarray
    first_deg: tuple[float, float]
    step_deg: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Clouds:
    """One shell of the paper's clouds: eq. (1) and the extinction of eq. (3).

    **Fields:**

    - `voxels`: of each texture, [n n n] float32; `period_m`, `weight` of each.
    - `bottom_m`, `ceiling_m`: of the shell that is marched.
    """

    voxels: tuple[np.ndarray, ...]
    period_m: tuple[float, ...]
    weight: tuple[float, ...]
    mask: Mask
    mask_gain: float
    threshold: float
    base_m: float
    top_m: float
    barrier_scale_m: float
    bottom_m: float
    ceiling_m: float
    extinction_per_m: float


@dataclass(frozen=True, eq=False)
class Work:
    """A picture to render.

    **Fields:**

    - `origin_m`: of all rays, ECEF; `direction`: [rays, 3] unit vectors, float32.
    - `sun`: unit vector towards it.
    - `indirect`: share of the light that comes from everywhere above (section 2.3).
    """

    origin_m: np.ndarray
    direction: np.ndarray
    sun: np.ndarray
    indirect: float
    clouds: Clouds
    steps: int


@dataclass(frozen=True, eq=False)
class Picture:
    """Layers of cloud from the lowest up, in reflective bands and one emissive band.

    **Fields:**

    - `layers`: the same rays for all.
    - `depths_per_m`: extinction of each layer in each band, [layers bands].
    - `shares`: of scattered light that is not absorbed, eq. (4), [layers reflective].
    - `planck`: fk1, fk2, bc1, bc2 of the emissive band.
    - `air`: reflectance of the air in each reflective band.
    - `behind`: without cloud, reflectance factors and radiance, [bands rays].
    """

    layers: tuple[Work, ...]
    depths_per_m: np.ndarray
    shares: np.ndarray
    planck: np.ndarray
    air: np.ndarray
    behind: np.ndarray
