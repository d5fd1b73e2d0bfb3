"""How much of a scene a weather analysis holds."""

import numpy as np
from jaxtyping import Bool, Float

from cloudjax import FixedGrid
from cloudjax_data import DataError, WeatherCube


# Pixels per axis that stand for all.
_PIXELS = 100


def _scene_places(
    grid: FixedGrid,
) -> tuple[Float[np.ndarray, " places"], Float[np.ndarray, " places"]]:
    """Latitudes and longitudes of pixels all over the part that sees the Earth."""
    rows, columns = (
        np.unique(np.linspace(0, size - 1, min(size, _PIXELS)).round().astype(int))
        for size in grid.shape
    )
    pixels = (rows[:, None] * grid.shape[1] + columns[None, :]).ravel()
    ground, hit = grid.rays(pixels).ground()
    return ground.latitude_deg[hit], ground.longitude_deg[hit]


def held_share(cube: WeatherCube, grid: FixedGrid) -> float:
    """Return the share of a scene's pixels, of those that see the Earth, for whose
    places an analysis has values.

    **Raises:** `DataError` if there are none.
    """
    *_, held = held_places(cube, grid)
    return float(held.mean()) if held.size else 1.0


def held_places(
    cube: WeatherCube, grid: FixedGrid
) -> tuple[
    Float[np.ndarray, " places"],
    Float[np.ndarray, " places"],
    Bool[np.ndarray, " places"],
]:
    """Return latitudes and longitudes [degrees] of pixels all over the part of an image
    that sees the Earth, and for which of them an analysis has values.

    **Raises:** `DataError` if there are none.
    """
    latitude, longitude = _scene_places(grid)
    held = cube.holds(latitude, longitude)
    if latitude.size and not held.any():
        raise DataError(
            f"{cube.path} covers {cube.extent}, and nothing of the scene, which is at "
            f"latitudes {latitude.min():.4g} to {latitude.max():.4g}, around longitude "
            f"{_middle(longitude):.4g}: get the analysis of that place, or go on "
            "without it with --ignore-weather."
        )
    return latitude, longitude, held


def _middle(longitude_deg: np.ndarray) -> float:
    direction = np.exp(1j * np.radians(longitude_deg)).mean()
    return float(np.degrees(np.angle(direction)))
