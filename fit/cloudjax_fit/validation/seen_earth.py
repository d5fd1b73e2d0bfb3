"""What an image shows of an Earth's clouds, pixel by pixel, with places and areas."""

import functools as ft
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from os import PathLike
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Int

from cloudjax import FixedGrid
from cloudjax.geometry.geodesy import ecef
from cloudjax_data import DataError
from cloudjax_fit.band_radiances import BandRadiances
from cloudjax_fit.radiance_files import read_radiances


# Fields that `cloudjax render SENSOR` writes beside the radiances of every sensor.
PRODUCTS = ("cloud_fraction", "cloud_optical_depth", "cloud_top_height")
_CLASS, _NAMES = "cloud_class", "flag_meanings"
# From geostationary orbit a pixel takes 3.57 times the ground of one below the
# satellite where the view is at 70 degrees from the vertical. Beyond, the sides of
# clouds hide what is between them.
MOST_STRETCH = 3.57
LEAST_ROWS = 8
# Rays whose ground is found at a time.
_RAYS = 1_000_000


@dataclass(frozen=True, eq=False)
class SeenEarth:
    """`SeenEarth` is what a file of `cloudjax render` shows.

    **Fields:**

    - `name`, `time`: of the file, and of its image in UTC.
    - `latitude_deg`, `longitude_deg`: where pixels meet the ground, else NaN.
    - `fraction`, `optical_depth`: of cloud in each pixel, the depth from straight above
      and as a mean over the pixel.
    - `top_m`: mean altitude of the cloud's tops [m], NaN without cloud.
    - `bands`: radiances by number, images of the same pixels.
    - `cloud_class`: number of the class that stops the most light, 0 is none; named by
      `class_names`, from 1. None and nothing in a file that does not tell.
    """

    name: str
    time: datetime
    latitude_deg: Float[np.ndarray, "y x"]
    longitude_deg: Float[np.ndarray, "y x"]
    fraction: Float[np.ndarray, "y x"]
    optical_depth: Float[np.ndarray, "y x"]
    top_m: Float[np.ndarray, "y x"]
    bands: Mapping[int, BandRadiances]
    cloud_class: Int[np.ndarray, "y x"] | None = None
    class_names: tuple[str, ...] = ()

    @ft.cached_property
    def area_m2(self) -> Float[np.ndarray, "y x"]:
        """Give the ground that each pixel takes [m²], NaN at edges of the Earth."""
        return pixel_areas_m2(self.latitude_deg, self.longitude_deg)

    @ft.cached_property
    def counted(self) -> Bool[np.ndarray, "y x"]:
        """Tell the pixels that see the Earth steeply enough."""
        area = self.area_m2
        known = np.isfinite(area) & np.isfinite(self.fraction)
        if not known.any():
            return known
        return known & (np.nan_to_num(area) <= MOST_STRETCH * area[known].min())

    @property
    def pixel_km(self) -> float:
        """Give the width of the finest pixel [km]."""
        return float(np.sqrt(self.area_m2[self.counted].min())) / 1e3


def read_seen_earth(path: str | PathLike[str]) -> SeenEarth:
    """Read a file that `cloudjax render SENSOR` wrote.

    **Raises:** `DataError` for another file, one without cloud products, time or
    places, or an image of a few pixels.
    """
    path = Path(path)
    if path.is_dir():
        raise DataError(
            f"{path} is a folder: give the netCDF file that cloudjax render SENSOR "
            "--weather wrote."
        )
    bands = read_radiances(path)
    fields, classes = _fields(path)
    shape = fields["cloud_fraction"].shape
    time = next((band.time for band in bands.values()), None)
    if time is None:
        raise DataError(
            f"{path} has no time: write it again with cloudjax render SENSOR."
        )
    if len(shape) != 2 or min(shape) < LEAST_ROWS:
        raise DataError(
            f"{path} is no image of {LEAST_ROWS} rows and columns at least: render a "
            "larger one."
        )
    latitude, longitude = _places(path, fields, bands)
    seen = SeenEarth(
        path.name,
        time,
        latitude,
        longitude,
        fields["cloud_fraction"],
        fields["cloud_optical_depth"],
        fields["cloud_top_height"],
        {n: band for n, band in bands.items() if band.values.shape == shape},
        *classes,
    )
    if not seen.counted.any():
        raise DataError(f"{path} sees nothing of the Earth: render another view.")
    return seen


def pixel_areas_m2(
    latitude_deg: Float[np.ndarray, "y x"], longitude_deg: Float[np.ndarray, "y x"]
) -> Float[np.ndarray, "y x"]:
    """Return the ground between the middles of the neighbours of each pixel [m²], flat
    and by the places of their centres; NaN where one is not on the Earth.
    """
    place = ecef(latitude_deg, longitude_deg, np.zeros(latitude_deg.shape))
    down, across = (np.gradient(place, axis=axis) for axis in (0, 1))
    return np.linalg.norm(np.cross(down, across), axis=-1)


def _fields(path: Path):
    """Products and places by name, and what a `SeenEarth` has of classes."""
    import xarray as xr

    from cloudjax_data.plain_path import plain_path

    wanted = (*PRODUCTS, "latitude", "longitude")
    with (
        plain_path(path) as plain,
        xr.open_dataset(plain, engine="netcdf4") as dataset,
    ):
        fields = {
            name: dataset[name].to_numpy().astype(float)
            for name in wanted
            if name in dataset.variables
        }
        told = dataset.variables.get(_CLASS)
        classes = None, ()
        if told is not None and _NAMES in told.attrs:
            names = tuple(str(told.attrs[_NAMES]).split())
            classes = told.to_numpy().astype(int), names[1:]
    missing = [name for name in PRODUCTS if name not in fields]
    if missing:
        raise DataError(
            f"{path} has no {', '.join(missing)}: give a file that cloudjax render "
            "SENSOR --weather wrote, which has them always."
        )
    return fields, classes


def _places(path: Path, fields, bands: Mapping[int, BandRadiances]):
    """Latitudes and longitudes: a camera's are in the file, a fixed grid's follow."""
    if {"latitude", "longitude"} <= fields.keys():
        return fields["latitude"], fields["longitude"]
    grid = next((band.grid for band in bands.values() if band.grid is not None), None)
    if grid is None:
        raise DataError(
            f"{path} does not say where its pixels are: write it again with cloudjax "
            "render SENSOR."
        )
    return _ground_of(grid)


def _ground_of(grid: FixedGrid):
    latitude, longitude = (np.full(grid.shape, np.nan) for _ in range(2))
    for part in np.array_split(
        np.arange(latitude.size), max(latitude.size // _RAYS, 1)
    ):
        ground, hit = grid.rays(part).ground()
        latitude.flat[part] = np.where(hit, ground.latitude_deg, np.nan)
        longitude.flat[part] = np.where(hit, ground.longitude_deg, np.nan)
    return latitude, longitude
