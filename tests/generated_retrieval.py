"""Small COD and ACHA files, as NOAA writes them and as others pass them on."""

from datetime import UTC, datetime
from pathlib import Path

import netCDF4
import numpy as np

from cloudjax import FixedGrid
from tests.generated import (
    _file_name,
    _write_grid,
    _write_header,
    _write_packed,
    window,
)


START = datetime(2022, 7, 1, 0, 1, 17, 600000, tzinfo=UTC)
SECONDS = 237.0
SLOT = "GOES-East"
COD_WORDS = {
    "day_algorithm_pixel_qf": (1, 0),
    "night_algorithm_pixel_qf": (1, 1),
    "good_quality_qf": (30, 0),
    "degraded_quality_due_to_twilight_qf": (30, 4),
    "invalid_due_to_clear_conditions_qf": (30, 6),
    "invalid_due_to_missing_or_bad_input_data_qf": (30, 14),
}
ACHA_WORDS = {
    "good_quality_qf": (None, 0),
    "invalid_due_to_not_geolocated_qf": (None, 1),
    "invalid_due_to_clear_or_probably_clear_sky_qf": (None, 4),
}
CLEAR, BAD, NIGHT = 6, 14, 1
NO_HEIGHT = 4


def scene(rows: int = 20, columns: int = 20, km: float = 2.0) -> FixedGrid:
    """Pixels of GOES-East at 34 N 107 W, 52° from its nadir."""
    return window(
        (rows, columns),
        28e-6 * km,
        west_edge_rad=-0.0756,
        north_edge_rad=0.0952,
        subsatellite_longitude_deg=-75.0,
    )


def write_cod(folder: Path, depth: np.ndarray, flags: np.ndarray | int = 0, **more):
    """Write optical depths; where there is none, the pixel is flagged as clear."""
    flags = np.where(np.isnan(depth), CLEAR, 0) | flags
    grid = more.pop("grid", None) or scene(*depth.shape)
    return _write(folder, "COD", depth, flags, COD_WORDS, grid, **more)


def write_acha(folder: Path, top_m: np.ndarray, product: str = "ACHA", **more):
    """Write heights on pixels of 10 km."""
    flags = np.where(np.isnan(top_m), NO_HEIGHT, 0)
    grid = more.pop("grid", None) or scene(*top_m.shape, km=10)
    return _write(folder, product, top_m, flags, ACHA_WORDS, grid, **more)


_STORED = {
    "COD": ("COD", "atmosphere_optical_thickness_due_to_cloud", "1", 0.00244163),
    "ACHA": ("HT", "geopotential_height_at_cloud_top", "m", 0.3052037),
}


def _write(
    folder: Path,
    product: str,
    values: np.ndarray,
    flags: np.ndarray,
    words: dict,
    grid: FixedGrid,
    *,
    start: datetime = START,
    platform: str = "G16",
    renamed: bool = False,
) -> Path:
    """**Arguments:** `renamed`: without projection and header, under other names, with
    latitudes and longitudes.
    """
    variable, standard, units, scale = _STORED[product[:4]]
    folder.mkdir(exist_ok=True)
    name = _file_name(f"L2-{product}", "C", "", platform, start, SECONDS)
    path = folder / name
    with netCDF4.Dataset(path, "w") as file:
        _write_header(file, name, start, SECONDS, platform, SLOT, "C")
        _write_grid(file, grid)
        _write_packed(
            file,
            variable,
            values,
            (scale, 0.0, 65535),
            {"standard_name": standard, "units": units, "ancillary_variables": "DQF"},
        )
        _write_words(file, flags, words)
    return _passed_on(path, variable, grid) if renamed else path


def _write_words(file: netCDF4.Dataset, flags: np.ndarray, words: dict) -> None:
    byte = file.createVariable("DQF", "i1", ("y", "x"), fill_value=np.int8(-1))
    byte.set_auto_maskandscale(False)
    masks, values = zip(*words.values(), strict=True)
    byte.setncatts(
        {
            "_Unsigned": "true",
            "standard_name": "status_flag",
            "flag_values": np.array(values, np.int8),
            "flag_meanings": " ".join(words),
        }
        | ({} if None in masks else {"flag_masks": np.array(masks, np.int8)})
    )
    byte[:] = flags.astype(np.uint8).view(np.int8)


def _passed_on(path: Path, variable: str, grid: FixedGrid) -> Path:
    other = path.with_stem(f"{path.stem}_select")
    dropped = ("goes_imager_projection", "nominal_satellite_subpoint_lon")
    names = {variable: "var1", "DQF": "flag"}
    with netCDF4.Dataset(path) as old, netCDF4.Dataset(other, "w") as new:
        old.set_auto_maskandscale(False)
        for dimension, size in old.dimensions.items():
            new.createDimension(dimension, len(size))
        for name, held in old.variables.items():
            if name in dropped:
                continue
            attributes = held.__dict__
            fill = attributes.pop("_FillValue", None)
            copy = new.createVariable(
                names.get(name, name), held.dtype, held.dimensions, fill_value=fill
            )
            copy.set_auto_maskandscale(False)
            copy.setncatts(attributes)
            copy[...] = held[...]
        ground, _ = grid.rays().ground()
        for name, place in (
            ("lat", ground.latitude_deg),
            ("lon", ground.longitude_deg),
        ):
            new.createVariable(name, "f4", ("y", "x"))[:] = place.reshape(grid.shape)
    path.unlink()
    return other


def write_retrieval(folder: Path, depth: np.ndarray, top_m: np.ndarray, **more) -> Path:
    """Write both files of one scan."""
    write_cod(folder, depth, **more)
    write_acha(folder, top_m, **more)
    return folder
