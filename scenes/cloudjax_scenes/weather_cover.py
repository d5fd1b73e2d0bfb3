"""How much of a scene a weather analysis holds."""

import numpy as np
from jaxtyping import Bool, Float

from cloudjax import FixedGrid
from cloudjax_data import DataError, WeatherCube

from .scene_places import scene_places, where


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
    latitude, longitude = scene_places(grid)
    held = cube.holds(latitude, longitude)
    if latitude.size and not held.any():
        raise DataError(
            f"{cube.path} covers {cube.extent}, and nothing of the scene, which is at "
            f"{where(latitude, longitude)}: get the analysis of that place, or go on "
            "without it with --ignore-weather."
        )
    return latitude, longitude, held
