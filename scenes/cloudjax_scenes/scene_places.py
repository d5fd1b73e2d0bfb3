"""The pixels of an image have places, which are said in words."""

import numpy as np
from jaxtyping import Float

from cloudjax import FixedGrid


# Pixels per axis that stand for all.
_PIXELS = 100


def scene_places(
    grid: FixedGrid,
) -> tuple[Float[np.ndarray, " places"], Float[np.ndarray, " places"]]:
    """Return latitudes and longitudes [degrees] of pixels all over the part of an image
    that sees the Earth.
    """
    rows, columns = (
        np.unique(np.linspace(0, size - 1, min(size, _PIXELS)).round().astype(int))
        for size in grid.shape
    )
    pixels = (rows[:, None] * grid.shape[1] + columns[None, :]).ravel()
    ground, hit = grid.rays(pixels).ground()
    return ground.latitude_deg[hit], ground.longitude_deg[hit]


def where(
    latitude_deg: Float[np.ndarray, "*n"], longitude_deg: Float[np.ndarray, "*n"]
) -> str:
    """Return where places are, in words."""
    direction = np.exp(1j * np.radians(longitude_deg)).mean()
    middle = float(np.degrees(np.angle(direction)))
    return (
        f"latitudes {latitude_deg.min():.4g} to {latitude_deg.max():.4g}, around "
        f"longitude {middle:.4g}"
    )
