"""Simulated images as CF netCDF files and as pictures."""

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import xarray as xr

import cloudjax
from cloudjax_data import GRID_MAPPING, fixed_grid_coordinates
from cloudjax_data.whole_files import staged

from .band_image import BandImage, write_band_picture
from .imagery import Imagery
from .lights import Light
from .netcdf import write_netcdf
from .quality import Quality, quality_attributes
from .quantity import RADIANCE, Quantity
from .simulated_image import SimulatedImage


def image_dataset(
    image: SimulatedImage,
    imagery: Imagery,
    parameters: Mapping[str, float],
    seed: int,
    quantities: Sequence[Quantity] = (RADIANCE,),
    *,
    light: Light,
    quality: Quality,
    asked: str = "",
) -> xr.Dataset:
    """Make a CF-1.8 Dataset with `radiance_C01` ... and `cloud_weight` on `(y, x)`.

    **Arguments:**

    - `light`, `quality`: it was rendered with.
    - `asked`: a digest of what the run was asked to do, to be known again by.
    """
    coordinates = fixed_grid_coordinates(imagery.grid)
    # Not "t", as in ABI files: xarray would take it for a part of the name of the grid
    # mapping and read it back as a data variable.
    coordinates["time"] = xr.DataArray(
        np.datetime64(imagery.time.replace(tzinfo=None), "ns"),
        attrs={"standard_name": "time", "long_name": "middle of the scan, UTC"},
    )
    variables = {
        name: array
        for each in band_images(image, imagery)
        for name, array in each.variables(quantities).items()
    }
    for array in variables.values():
        array.encoding["grid_mapping"] = GRID_MAPPING
    return xr.Dataset(
        variables | {"cloud_weight": _cloud_weight(image)},
        coords=coordinates,
        attrs={
            "Conventions": "CF-1.8",
            "title": "Simulated ABI radiances",
            "source": f"cloudjax {cloudjax.__version__}",
            "platform_ID": imagery.platform,
            "scene": imagery.name,
            "cloud_rule": str(imagery.rule),
            "parameters": json.dumps(dict(parameters)),
            "seed": seed,
        }
        | quality_attributes(quality, light)
        | ({"asked": asked} if asked else {}),
    )


def write_image_and_picture(
    path: str | os.PathLike[str],
    image: SimulatedImage,
    imagery: Imagery,
    parameters: Mapping[str, float],
    seed: int,
    quantities: Sequence[Quantity] = (RADIANCE,),
    *,
    light: Light,
    quality: Quality,
    asked: str = "",
) -> None:
    """Write a netCDF file, and a PNG of the same name beside it.

    **Arguments:** as of `image_dataset`.

    **Raises:** `DataError` if the disk does not take them.
    """
    path = Path(path)
    with staged(path.parent, last=path.name) as aside:
        write_band_picture(
            aside / path.with_suffix(".png").name,
            band_images(image, imagery),
            f"{imagery.platform} {imagery.time:%Y-%m-%d %H:%M:%S} UTC, simulated",
            panel_inches=4.6,
            missing="#dbe6f2",
        )
        data = image_dataset(
            image,
            imagery,
            parameters,
            seed,
            quantities,
            light=light,
            quality=quality,
            asked=asked,
        )
        write_netcdf(aside / path.name, data)


def band_images(image: SimulatedImage, imagery: Imagery) -> list[BandImage]:
    """Return the radiances of each band, in the order of their numbers."""
    return [
        BandImage(
            imagery.bands[number], imagery.coefficients(number), image.band(number)
        )
        for number in sorted(image.bands)
    ]


def _cloud_weight(image: SimulatedImage) -> xr.DataArray:
    array = xr.DataArray(
        image.cloud.astype(np.float32),
        dims=("y", "x"),
        attrs={
            "long_name": "share of the pixel that counts as cloud by the cloud rule",
            "units": "1",
        },
    )
    array.encoding["grid_mapping"] = GRID_MAPPING
    return array
