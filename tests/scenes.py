"""Whole scene folders, as small as a fit allows."""

from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter

from cloudjax_data import ReflectiveCalibration
from tests.generated import (
    SCAN_START,
    default_calibration,
    window,
    write_abi_l1b,
    write_grib,
)


NIGHT = datetime(2019, 12, 1, 10, 27, 27, 500000, tzinfo=UTC)
SHAPE = (48, 48)
LEVELS = {1000: 110.0, 700: 3000.0, 500: 5600.0, 300: 9200.0, 100: 16500.0}


def write_scene(
    folder: Path,
    bands: Iterable[int] = (1, 3, 13),
    start: datetime = SCAN_START,
    seed: int = 0,
    shape: tuple[int, int] = SHAPE,
) -> Path:
    """Half of it low cloud, some under a higher one, in L1b files on 2 km."""
    folder.mkdir(parents=True, exist_ok=True)
    fields = [_field(seed + i, shape) for i in range(4)]
    low, high = fields[0] > 0.0, fields[1] > 0.5
    height_m = np.where(high, 8000.0, np.where(low, 1500.0, 0.0))
    temperature_k = 290.0 - 6.5e-3 * height_m + fields[2]
    reflectance = np.where(low | high, 0.5 + 0.08 * fields[3], 0.06)
    for band in bands:
        calibration = default_calibration(band)
        reflects = isinstance(calibration, ReflectiveCalibration)
        seen = calibration.radiance(reflectance if reflects else temperature_k)
        write_abi_l1b(folder, band=band, radiance=seen, grid=window(shape), start=start)
    return folder


def write_weather(folder: Path, time: datetime) -> Path:
    """A global analysis of one uniform air mass."""
    latitude, longitude = np.arange(90.0, -91.0, -30.0), np.arange(0.0, 360.0, 30.0)
    shape = latitude.size, longitude.size
    values = {"u": 5.0, "v": 1.0, "w": 0.1, "r": 60.0, "t": 270.0}
    fields = {
        (name, level): np.full(shape, value)
        for name, value in values.items()
        for level in LEVELS
    } | {("gh", level): np.full(shape, height) for level, height in LEVELS.items()}
    return write_grib(
        folder / "gfs.grib2",
        fields,
        latitude_deg=latitude,
        longitude_deg=longitude,
        time=time,
    )


def _field(seed: int, shape: tuple[int, int]) -> np.ndarray:
    noise = gaussian_filter(np.random.default_rng(seed).standard_normal(shape), 2.0)
    return noise / noise.std()
