"""Simulated images as CF netCDF files and as pictures."""

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from cloudjax_data import GRID_MAPPING, fixed_grid_coordinates
from cloudjax_data.whole_files import staged
from cloudjax_fit.fitting import SimulatedImage, versions
from cloudjax_fit.targets import Target

from .band_image import BandImage, write_band_picture
from .netcdf import write_netcdf
from .quantity import RADIANCE, Quantity


def image_dataset(
    image: SimulatedImage,
    target: Target,
    parameters: Mapping[str, float],
    seed: int,
    quantities: Sequence[Quantity] = (RADIANCE,),
    *,
    shadows: int = 0,
) -> xr.Dataset:
    """A CF-1.8 Dataset with `radiance_C01` ... and `cloud_weight` on `(y, x)`.

    **Arguments:** `shadows`: the steps of its shadows.
    """
    coordinates = fixed_grid_coordinates(target.grid)
    # Not "t", as in ABI files: xarray would take it for a part of the name of the grid
    # mapping and read it back as a data variable.
    coordinates["time"] = xr.DataArray(
        np.datetime64(target.time.replace(tzinfo=None), "ns"),
        attrs={"standard_name": "time", "long_name": "middle of the scan, UTC"},
    )
    variables = {
        name: array
        for each in band_images(image, target)
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
            "source": f"cloudjax {versions()['cloudjax']}",
            "platform_ID": target.platform,
            "scene": target.name,
            "cloud_rule": str(target.rule),
            "parameters": json.dumps(dict(parameters)),
            "seed": seed,
            "shadow_steps": shadows,
        },
    )


def write_image_and_picture(
    path: str | os.PathLike[str],
    image: SimulatedImage,
    target: Target,
    parameters: Mapping[str, float],
    seed: int,
    quantities: Sequence[Quantity] = (RADIANCE,),
    *,
    shadows: int = 0,
) -> None:
    """Write a netCDF file, and a PNG of the same name beside it.

    **Raises:** `DataError` if the disk does not take them.
    """
    path = Path(path)
    with staged(path.parent, last=path.name) as aside:
        write_band_picture(
            aside / path.with_suffix(".png").name,
            band_images(image, target),
            f"{target.platform} {target.time:%Y-%m-%d %H:%M:%S} UTC, simulated",
            panel_inches=4.6,
            missing="#dbe6f2",
        )
        data = image_dataset(
            image, target, parameters, seed, quantities, shadows=shadows
        )
        write_netcdf(aside / path.name, data)


def band_images(image: SimulatedImage, target: Target) -> list[BandImage]:
    """The radiances of each band, in the order of their numbers."""
    return [
        BandImage(
            target.bands[number], target.bands[number].coefficients, image.band(number)
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
