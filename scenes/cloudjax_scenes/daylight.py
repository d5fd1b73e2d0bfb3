"""How high the sun stands over an image."""

from dataclasses import replace
from datetime import datetime

import numpy as np

from cloudjax import FixedGrid
from cloudjax.geometry.geodesy import up
from cloudjax_data import sun_direction


# Below this height of the sun the reflective bands tell nothing of cloud.
LOWEST_SUN_DEG = 5.0
# Along each axis: the sun is smooth, and a megapixel takes a second.
_POINTS = 50


def sun_heights_deg(grid: FixedGrid, time: datetime) -> tuple[float, float]:
    """Return the lowest and the highest sun over the pixels that see the Earth.

    Below the horizon is negative; NaN if no pixel sees the Earth.
    """
    thin = replace(grid, x_rad=_thinned(grid.x_rad), y_rad=_thinned(grid.y_rad))
    ground, hit = thin.rays().ground(grid.ellipsoid)
    if not hit.any():
        return np.nan, np.nan
    vertical = up(ground.latitude_deg[hit], ground.longitude_deg[hit])
    height = np.degrees(np.arcsin(vertical @ sun_direction(time)))
    return float(height.min()), float(height.max())


def shows_sunlit_clouds(heights_deg: tuple[float, float]) -> bool:
    """Tell whether reflective bands see clouds anywhere in the image."""
    return heights_deg[1] >= LOWEST_SUN_DEG


def _thinned(angles: np.ndarray) -> np.ndarray:
    return np.linspace(angles[0], angles[-1], min(len(angles), _POINTS))
