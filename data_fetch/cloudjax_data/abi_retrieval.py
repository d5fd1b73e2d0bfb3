"""Optical depth and top height of the clouds of one scan, from two L2 files of ABI."""

from dataclasses import dataclass
from datetime import datetime
from os import PathLike
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float

from cloudjax.geometry.fixed_grid import FixedGrid

from .abi_name import SAME_SCAN
from .abi_product import OPTICAL_DEPTH, TOP_HEIGHT, AbiProduct, read_product
from .errors import DataError
from .scene_folder import SceneFolder, open_folder


# Of these the first that is there: ACHA2KM has the heights at 2 km instead of 10.
_OF_DEPTH, _OF_HEIGHT = ("COD",), ("ACHA2KM", "ACHA")
# No cloud is higher, but for the stratosphere's [m].
_HIGHEST_M = 20e3


@dataclass(frozen=True, eq=False)
class CloudRetrieval:
    """A `CloudRetrieval` is what one scan tells of optical depth and top height.

    **Fields:**

    - `folder`: where the files are; `paths`: the files.
    - `grid`: scan angles of the pixels of the optical depth.
    - `optical_depth`: vertical, at 0.64 µm; 0 where it is clear or unknown.
    - `top_m`: height of the top; NaN where there is no cloud.
    - `unknown`: pixels that see the Earth and of which the flags let nothing count.
    - `filled`: clouds without a height of their own, which have that of the nearest
      pixel with one.
    - `night`: clouds whose optical depth is by the algorithm of the night.
    - `platform`: "G16" ...; `sector`: "F", "C", "M1" or "M2".
    - `time`: middle of the scan, in UTC.
    """

    folder: Path
    paths: tuple[Path, ...]
    grid: FixedGrid
    optical_depth: Float[np.ndarray, "y x"]
    top_m: Float[np.ndarray, "y x"]
    unknown: Bool[np.ndarray, "y x"]
    filled: Bool[np.ndarray, "y x"]
    night: Bool[np.ndarray, "y x"]
    platform: str
    sector: str
    time: datetime

    @property
    def cloudy(self) -> Bool[np.ndarray, "y x"]:
        """Tell where there is cloud."""
        return self.optical_depth > 0

    def require_cloud(self) -> None:
        """Raise `DataError` where there is no cloud at all."""
        if not self.cloudy.any():
            raise DataError(
                f"{self.folder} has no cloud ({self.unknown.sum()} of "
                f"{self.unknown.size} pixels are unknown, the others clear): choose "
                "another scan."
            )

    def cautions(self) -> list[str]:
        """Say what the files do not tell and what was put in its place."""
        of, clouds = self.unknown.size, int(self.cloudy.sum())
        said = (
            (
                self.unknown,
                f"of {of} pixels are unknown, by their quality flags: they are "
                "rendered as clear.",
            ),
            (
                self.filled,
                f"of {clouds} cloudy pixels have no top height: they have that of the "
                "nearest pixel with one.",
            ),
            (
                self.night,
                f"of {clouds} cloudy pixels have an optical depth by the night's "
                "algorithm, which cannot tell thick clouds apart: they are too thin.",
            ),
        )
        return [f"{where.sum()} {words}" for where, words in said if where.any()]


def read_retrieval(folder: str | PathLike[str]) -> CloudRetrieval:
    """Read the COD file and the ACHA file of one scan in a folder.

    Pixels that are invalid because they are clear have no cloud; pixels that are
    invalid otherwise are unknown; degraded ones count. Heights of coarser pixels serve
    all those whose centres they hold.

    **Raises:** `DataError` if one of the two is missing or broken, if they are of
    different scans or of different parts of it, or if no cloud has a height.
    """
    held = open_folder(folder)
    depth = read_product(_file(held, _OF_DEPTH), OPTICAL_DEPTH)
    height = read_product(_file(held, _OF_HEIGHT), TOP_HEIGHT)
    _check_same_scan(depth, height)
    clear = depth.flags.say("clear")
    known = depth.good & ~clear & (np.nan_to_num(depth.values) >= 0)
    tau = np.where(known, depth.values, 0.0)
    cloudy = tau > 0
    own = _heights_on(depth.grid, height)
    nearest = _from_nearest(own, height.path) if cloudy.any() else own
    return CloudRetrieval(
        folder=Path(folder),
        paths=(depth.path, height.path),
        grid=depth.grid,
        optical_depth=tau,
        top_m=np.where(cloudy, nearest, np.nan),
        unknown=~known & ~clear & depth.grid.sees_the_earth(),
        filled=cloudy & ~np.isfinite(own),
        night=cloudy & depth.flags.say("night"),
        platform=depth.platform,
        sector=depth.sector,
        time=depth.time,
    )


def holds_retrieval(folder: SceneFolder) -> bool:
    """Tell whether a folder has both files that `read_retrieval` needs."""
    return all(
        any(name in folder.products for name in names)
        for names in (_OF_DEPTH, _OF_HEIGHT)
    )


def _file(folder: SceneFolder, products: tuple[str, ...]) -> Path:
    for product in products:
        if product in folder.products:
            return folder.products[product]
    other = "ACHA" if products == _OF_DEPTH else "COD"
    raise DataError(
        f"{folder.path} has no {products[-1]} file: put that of the same scan beside "
        f"the {other} file."
    )


def _check_same_scan(depth: AbiProduct, height: AbiProduct) -> None:
    scans = [(p.platform, p.sector) for p in (depth, height)]
    same = depth.grid.same_projection_as(height.grid)
    if scans[0] == scans[1] and abs(depth.time - height.time) < SAME_SCAN and same:
        return
    said = [
        f"{p.platform} {p.sector} {p.time:%Y-%m-%d %H:%M:%S} above longitude "
        f"{p.grid.subsatellite_longitude_deg:g}"
        for p in (depth, height)
    ]
    raise DataError(
        f"{depth.path} and {height.path.name} are of different scans ({said[0]}; "
        f"{said[1]}): keep the files of one."
    )


def _heights_on(grid: FixedGrid, product: AbiProduct) -> Float[np.ndarray, "y x"]:
    """Heights of the pixels of a product that hold the pixels of a grid, NaN else."""
    possible = (product.values > -500) & (product.values <= _HIGHEST_M)
    heights = np.where(product.good & possible, product.values, np.nan)
    row, in_rows = _holding(grid.y_rad, product.grid.y_rad)
    column, in_columns = _holding(grid.x_rad, product.grid.x_rad)
    if not in_rows.any() or not in_columns.any():
        raise DataError(
            f"{product.path} sees none of the pixels of the optical depth beside it: "
            "get both for the same part of the scan."
        )
    held = in_rows[:, None] & in_columns
    return np.where(held, heights[np.ix_(row, column)], np.nan)


def _holding(angles, centres) -> tuple[np.ndarray, np.ndarray]:
    """Which of the pixels with these centres holds an angle, and whether one does."""
    step = (centres[-1] - centres[0]) / (len(centres) - 1)
    at = (angles - centres[0]) / step
    index = np.clip(np.rint(at), 0, len(centres) - 1).astype(int)
    # The edges of pixels may fall on centres, which files round.
    return index, np.abs(at - index) <= 0.5 + 0.01


def _from_nearest(heights: np.ndarray, path: Path) -> np.ndarray:
    # Readers of other files need not wait for scipy.
    from scipy.ndimage import distance_transform_edt

    missing = ~np.isfinite(heights)
    if missing.all():
        raise DataError(
            f"{path} has no height that its flags let count where the optical depth "
            "beside it is: choose another scan."
        )
    if not missing.any():
        return heights
    indices = distance_transform_edt(
        missing, return_distances=False, return_indices=True
    )
    return heights[tuple(np.asarray(indices))]
