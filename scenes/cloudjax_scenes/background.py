"""What is seen without clouds: clear pixels as they are, and under cloud the like.

Pixels that no rule takes for cloud are not clear for that: inside a deck they show what
is thin. At sea only those count that are as dark as the darker of them; land has no
such test. What is under cloud is filled from clear pixels of the like, land or sea.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import zoom

from cloudjax import FixedGrid, LatLonGrid

from .surface import Surface


# Near infrared, where the sea is darkest, the best first.
_DARK_BANDS = (5, 3, 6, 2)
# Sea is clear up to this reflectance above its darkest fifth ...
_DARKEST = 0.2
_BRIGHTER = 0.02
# ... of the surroundings, for the sun's glint and height change over a disc.
_SURROUNDINGS_PIXELS = 512


@dataclass(frozen=True, eq=False)
class Background:
    """Radiances without cloud, at places that a grid tells.

    **Fields:** `radiance`: by band, at the nodes of the grid.
    """

    grid: LatLonGrid | FixedGrid
    radiance: dict[int, Float[np.ndarray, "rows columns"]]

    def on(self, grid: FixedGrid) -> dict[int, Float[np.ndarray, "y x"]]:
        """Return the radiances by band at the pixels of an image."""
        if grid == self.grid:
            return self.radiance
        ground, _ = grid.rays().ground()
        nodes = np.stack(list(self.radiance.values()), axis=-1)
        places = ground.latitude_deg, ground.longitude_deg
        found = np.asarray(self.grid.sample(nodes, *places))
        return {
            number: found[:, i].reshape(grid.shape)
            for i, number in enumerate(self.radiance)
        }

    def coarsened(self, factor: int) -> "Background":
        """Return the means over blocks of pixels.

        **Raises:** `ValueError` when the blocks do not fill the grid.
        """
        assert isinstance(self.grid, FixedGrid)
        rows, columns = (n // factor for n in self.grid.shape)
        blocks = (rows, factor, columns, factor)
        means = {n: r.reshape(blocks).mean((1, 3)) for n, r in self.radiance.items()}
        return Background(self.grid.coarsened(factor), means)


@dataclass(frozen=True, eq=False)
class ClearPixels:
    """Pixels that are not cloud.

    **Fields:**

    - `sure`: those that surely show the ground.
    - `land`: all pixels of land, clear or not.
    """

    sure: Bool[np.ndarray, "y x"]
    land: Bool[np.ndarray, "y x"]


def clear_pixels(
    grid: FixedGrid,
    clear: Bool[np.ndarray, "y x"],
    reflectance: Mapping[int, Float[np.ndarray, "y x"]],
) -> ClearPixels:
    """Tell which of the pixels that are good and not cloud surely show the ground.

    **Arguments:** `reflectance`: by band.
    """
    ground, hit = grid.rays().ground()
    land = Surface.of().land_at(ground.latitude_deg, ground.longitude_deg) > 0.5
    land, earth = land.reshape(grid.shape), hit.reshape(grid.shape)
    clear = clear & earth
    return ClearPixels(clear & (land | _dark(clear & ~land, reflectance)), land)


def observed_background(
    grid: FixedGrid,
    clear: ClearPixels,
    radiance: Mapping[int, Float[np.ndarray, "y x"]],
) -> Background:
    """Return the radiances of surely clear pixels, with those under cloud filled.

    **Arguments:** `clear`: one at least is sure. `radiance`: by band.
    """
    return Background(
        grid,
        {
            number: _filled(np.asarray(image, np.float64), clear.sure, clear.land)
            for number, image in radiance.items()
        },
    )


def _dark(sea, reflectance) -> Bool[np.ndarray, "y x"]:
    """Sea that is as dark as the darker part of what surrounds it."""
    band = next((n for n in _DARK_BANDS if n in reflectance), None)
    if band is None:
        return sea
    dark = np.zeros(sea.shape, bool)
    size = _SURROUNDINGS_PIXELS
    for row in range(0, sea.shape[0], size):
        for column in range(0, sea.shape[1], size):
            part = np.s_[row : row + size, column : column + size]
            values = reflectance[band][part]
            if sea[part].any():
                limit = np.quantile(values[sea[part]], _DARKEST) + _BRIGHTER
                dark[part] = sea[part] & (values <= limit)
    return dark


def _filled(image, known, land) -> Float[np.ndarray, "y x"]:
    """The image where it is known, and elsewhere what is known of the same kind."""
    found = _pulled_and_pushed(image, known)
    for kind in (land, ~land):
        own = known & kind
        if own.any():
            found = np.where(kind & ~known, _pulled_and_pushed(image, own), found)
    return found


def _pulled_and_pushed(image, known) -> Float[np.ndarray, "y x"]:
    """Means over ever wider blocks fill what is not known (Gortler et al. 1996, The
    Lumigraph, section 3.4)."""
    if known.all() or max(image.shape) == 1:
        return image
    count = _halved(known.astype(float))
    mean = _halved(np.where(known, image, 0.0)) / np.maximum(count, 1)
    wide = _pulled_and_pushed(mean, count > 0)
    wide = np.asarray(zoom(wide, 2, order=1, mode="nearest", grid_mode=True))
    return np.where(known, image, wide[: image.shape[0], : image.shape[1]])


def _halved(image) -> Float[np.ndarray, "y x"]:
    """Sums over blocks of two by two pixels; what is missing at the edges is 0."""
    rows, columns = image.shape
    even = np.pad(image, ((0, rows % 2), (0, columns % 2)))
    return even.reshape(-(-rows // 2), 2, -(-columns // 2), 2).sum((1, 3))
