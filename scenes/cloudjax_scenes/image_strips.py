"""Images of any size, rendered and written strip by strip.

The memory that a strip takes does not grow with the image.
"""

import dataclasses
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from datetime import datetime
from pathlib import Path

import netCDF4
import numpy as np
import xarray as xr

from cloudjax import Band, FixedGrid
from cloudjax_data.whole_files import staged

from .band_image import BandImage
from .film import Frame
from .model_scene import ModelWorld
from .netcdf import disk_errors, write_netcdf
from .quantity import RADIANCE, Quantity
from .sensor_image import SensorImage, render_sensor, sensor_dataset, write_picture
from .sensors import Sensor
from .weather_scene import World
from .winds import Winds


# Some 600 MB with the rays of all pixels in float64.
PIXELS_AT_ONCE = 1 << 20
# A picture has no more columns than this, and a film, whose frames are all held.
PICTURE_PIXELS, FILM_PIXELS = 1500, 600
_CHUNK = 512


def strips(sensor: Sensor, pixels: int = PIXELS_AT_ONCE) -> list[Sensor]:
    """Cut the sensor into strips of whole rows; a camera is one strip."""
    view = sensor.view
    if not isinstance(view, FixedGrid):
        return [sensor]
    rows, columns = view.shape
    height = max(pixels // columns, 1)
    return [
        dataclasses.replace(
            sensor, view=dataclasses.replace(view, y_rad=view.y_rad[i : i + height])
        )
        for i in range(0, rows, height)
    ]


def render_strips(
    world: World | ModelWorld,
    sensor: Sensor,
    bands: list[Band],
    time: datetime,
    winds: Winds | None = None,
    *,
    pixels: int = PIXELS_AT_ONCE,
    on_tile: Callable[[int, int], None] | None = None,
) -> Iterator[SensorImage]:
    """Render one frame from the top down; arguments as for `render_sensor`.

    `on_tile` is called with numbers of pixels.
    """
    if winds is None and isinstance(world, World):
        winds = world.winds(time)
    every, above = np.prod(sensor.view.shape), 0
    for strip in strips(sensor, pixels):
        size = np.prod(strip.view.shape)

        def in_strip(done: int, count: int, above=above, size=size) -> None:
            if on_tile is not None:
                on_tile(int(above + size * done / count), int(every))

        yield render_sensor(world, strip, bands, time, winds, on_tile=in_strip)
        above += size
    if on_tile is not None:
        on_tile(int(every), int(every))


def write_strips(
    path: str | os.PathLike[str],
    images: Iterable[SensorImage],
    world: World | ModelWorld,
    quantities: Sequence[Quantity] = (RADIANCE,),
) -> Frame:
    """Write strips from the top down as one CF netCDF file, and a PNG beside it.

    Of large images the picture shows every so many pixels.

    **Returns:** what a film shows of it.

    **Raises:** `DataError` if the disk does not take them.
    """
    path = Path(path)
    with staged(path.parent, last=path.name) as aside:
        shown: list[list[BandImage]] = []
        title = ""
        for image in images:
            strip = sensor_dataset(image, world, quantities)
            write = _append if shown else _begin
            write(aside / path.name, strip)
            shown.append([_thinned(band, PICTURE_PIXELS) for band in image.bands()])
            title = image.title
        bands = [_joined(parts) for parts in zip(*shown, strict=True)]
        write_picture(aside / path.with_suffix(".png").name, bands, title)
    return Frame(title, tuple(_thinned(band, FILM_PIXELS) for band in bands))


def _begin(file: Path, strip: xr.Dataset) -> None:
    for variable in strip.variables.values():
        if variable.dims == ("y", "x"):
            variable.encoding["chunksizes"] = tuple(
                min(_CHUNK, size) for size in variable.shape
            )
    # Further strips make y longer.
    strip.encoding["unlimited_dims"] = {"y"}
    write_netcdf(file, strip)


def _append(file: Path, strip: xr.Dataset) -> None:
    with disk_errors(), netCDF4.Dataset(file, "a") as whole:
        start = len(whole.dimensions["y"])
        for name, variable in strip.variables.items():
            if "y" in variable.dims:
                whole[str(name)][start:] = variable.to_numpy()


def _thinned(band: BandImage, most: int) -> BandImage:
    """Every so many pixels of a strip, by the width that it shares with the whole."""
    every = max(-(-band.radiance.shape[1] // most), 1)
    return dataclasses.replace(band, radiance=band.radiance[::every, ::every])


def _joined(parts: Sequence[BandImage]) -> BandImage:
    rows = np.concatenate([part.radiance for part in parts])
    return dataclasses.replace(parts[0], radiance=rows)
