"""Simulated images as CF netCDF files and as pictures."""

import json
import os
from collections.abc import Mapping
from pathlib import Path

import matplotlib
import numpy as np
import xarray as xr
from jaxtyping import Float
from matplotlib.figure import Figure

import cloudjax_data
from cloudjax import FixedGrid
from cloudjax_data import (
    GRID_MAPPING,
    EmissiveCalibration,
    fixed_grid_coordinates,
)

from .figures import BRIGHTNESS_TEMPERATURE, REFLECTANCE, Display
from .fitting import SimulatedImage, versions
from .netcdf import write_netcdf
from .sensor_band import SensorBand
from .staging import staged
from .target import BandTarget, Target


def image_dataset(
    image: SimulatedImage,
    target: Target,
    parameters: Mapping[str, float],
    seed: int,
) -> xr.Dataset:
    """A CF-1.8 Dataset with `radiance_C01` ... and `cloud_weight` on `(y, x)`."""
    coordinates = fixed_grid_coordinates(data_grid(target.grid))
    # Not "t", as in ABI files: xarray would take it for a part of the name of the grid
    # mapping and read it back as a data variable.
    coordinates["time"] = xr.DataArray(
        np.datetime64(target.time.replace(tzinfo=None), "ns"),
        attrs={"standard_name": "time", "long_name": "middle of the scan, UTC"},
    )
    variables = {
        f"radiance_{target.bands[number].name}": radiance_array(
            image.band(number), target.bands[number]
        )
        for number in sorted(image.bands)
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
        },
    )


def write_image_and_picture(
    path: str | os.PathLike[str],
    image: SimulatedImage,
    target: Target,
    parameters: Mapping[str, float],
    seed: int,
) -> None:
    """Write a netCDF file, and a PNG of the same name beside it.

    **Raises:** `DataError` if the disk does not take them.
    """
    path = Path(path)
    with staged(path.parent, last=path.name) as aside:
        picture = path.with_suffix(".png").name
        write_picture(aside / picture, image, target)
        write_netcdf(aside / path.name, image_dataset(image, target, parameters, seed))


def write_picture(
    path: str | os.PathLike[str], image: SimulatedImage, target: Target
) -> None:
    """Write one grey panel per band as PNG: white is bright, or cold."""
    bands = [target.bands[number] for number in sorted(image.bands)]
    rows, columns = target.grid.shape
    height = 4.2 * min(max(rows / columns, 0.3), 2.0)
    figure = Figure(figsize=(4.6 * len(bands), height + 0.5), layout="compressed")
    panels = figure.subplots(1, len(bands), squeeze=False)[0]
    for axes, band in zip(panels, bands, strict=True):
        values, display = shown(image.band(band.number), band)
        shades = matplotlib.colormaps[display.colormap].with_extremes(bad="#dbe6f2")
        low, high = np.nanpercentile(values, [0.5, 99.5])
        drawn = axes.imshow(values, cmap=shades, vmin=low, vmax=high)
        axes.set_title(f"{band_title(band)}", fontsize=10)
        axes.set_xticks([])
        axes.set_yticks([])
        figure.colorbar(drawn, ax=axes, label=display.label, fraction=0.046, pad=0.02)
    figure.suptitle(
        f"{target.platform} {target.time:%Y-%m-%d %H:%M:%S} UTC, simulated", fontsize=11
    )
    figure.savefig(path, dpi=120, bbox_inches="tight", metadata={"Software": None})


def band_title(band: BandTarget) -> str:
    """Such as "C13 10.3 µm"."""
    return f"{band.name} {band.wavelength_um:.3g} µm"


def shown(
    radiance: Float[np.ndarray, "y x"], band: BandTarget
) -> tuple[Float[np.ndarray, "y x"], Display]:
    """An image in the quantity that people look at, and how to draw it."""
    if band.reflective:
        return radiance * band.coefficients["kappa0"], REFLECTANCE
    planck = EmissiveCalibration(**band.coefficients)
    return planck.brightness_temperature_k(radiance), BRIGHTNESS_TEMPERATURE


def radiance_array(
    values: Float[np.ndarray, "y x"], band: BandTarget | SensorBand
) -> xr.DataArray:
    """A band's radiance with its CF attributes."""
    per = "wavelength" if band.reflective else "wavenumber"
    return xr.DataArray(
        values.astype(np.float32),
        dims=("y", "x"),
        attrs={
            "standard_name": f"toa_outgoing_radiance_per_unit_{per}",
            "long_name": f"simulated radiance of ABI band {band.number}",
            "units": band.units,
            "abi_band": band.number,
            "wavelength_um": band.wavelength_um,
        },
    )


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


def data_grid(grid: FixedGrid) -> cloudjax_data.FixedGrid:
    """The renderer's fixed grid as that of the files."""
    return cloudjax_data.FixedGrid(
        x_rad=np.asarray(grid.x_rad, np.float64),
        y_rad=np.asarray(grid.y_rad, np.float64),
        subsatellite_longitude_deg=grid.subsatellite_longitude_deg,
        perspective_height_m=grid.perspective_height_m,
        semi_major_axis_m=grid.ellipsoid.semi_major_m,
        semi_minor_axis_m=grid.ellipsoid.semi_minor_m,
        sweep=grid.sweep,
    )
