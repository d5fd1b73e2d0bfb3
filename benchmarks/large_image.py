"""Time and peak memory of reading a full disk of the 0.5 km band, by parts and whole.

The file is made once, in the chunks of NOAA's: 21 696 x 21 696 counts of a smooth field
and noise, zlib level 1. Each reading runs in a process of its own, and its peak is the
resident memory of that process above what it had with the package imported. Linux only.
"""

import argparse
import json
import multiprocessing
import re
import time
from pathlib import Path

import netCDF4
import numpy as np

from cloudjax.geometry.geodesy import GRS80
from cloudjax_data.whole_files import whole


SIZE, CHUNK, STEP_RAD = 21696, 226, 1.4e-5
SCALE, OFFSET, FILL = 0.15859237, -20.289911, 4095
CASES = {
    "window of 2000 x 2000": {"window": (slice(9040, 11040), slice(9040, 11040))},
    "means of 4 x 4 (2 km)": {"block": 4},
    "means of 2 x 2 (1 km)": {"block": 2},
    "whole": {},
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=Path("out/large_image"))
    folder = parser.parse_args().output
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "OR_ABI-L1b-RadF-M6C02_G16_s20231161700206_e20231161709514_c0.nc"
    if not file.exists():
        write_file(file)
    print(f"{SIZE} x {SIZE}, {file.stat().st_size / 1e6:.0f} MB on disk")
    results = {}
    for name, options in CASES.items():
        seconds, megabytes, shape = measured(file, options)
        results[name] = {"seconds": seconds, "peak_mb": megabytes, "shape": shape}
        print(f"{name:<24}{seconds:7.1f} s {megabytes:8.0f} MB  {shape}")
    (folder / "results.json").write_text(json.dumps(results, indent=1))


def measured(file: Path, options: dict) -> tuple[float, float, tuple[int, int]]:
    """Seconds, megabytes above the start, and the shape that was read."""
    context = multiprocessing.get_context("spawn")
    with context.Pool(1) as pool:
        return pool.apply(reading, (file, options))


def reading(file: Path, options: dict) -> tuple[float, float, tuple[int, int]]:
    from cloudjax_data import read_band

    # Forgets the peak of the import.
    Path("/proc/self/clear_refs").write_text("5")
    start_mb = resident_mb("VmRSS")
    start = time.perf_counter()
    band = read_band(file, **options)
    seconds = time.perf_counter() - start
    return seconds, resident_mb("VmHWM") - start_mb, band.radiance.shape


def resident_mb(line: str) -> float:
    """Resident memory of this process, now (`VmRSS`) or at most (`VmHWM`)."""
    (found,) = re.findall(rf"{line}:\s+(\d+) kB", Path("/proc/self/status").read_text())
    return int(found) * 1024 / 1e6


def write_file(path: Path) -> None:
    """A band 2 file, written strip by strip and named when it is whole."""
    with whole(path) as aside, netCDF4.Dataset(aside, "w") as file:
        file.setncatts(
            {
                "dataset_name": path.name,
                "platform_ID": "G16",
                "orbital_slot": "GOES-East",
                "scene_id": "Full Disk",
                "time_coverage_start": "2023-04-26T17:00:20.6Z",
                "time_coverage_end": "2023-04-26T17:09:51.4Z",
            }
        )
        write_axes(file)
        write_scalars(file)
        write_image(file)


def write_axes(file: netCDF4.Dataset) -> None:
    edge = STEP_RAD * (SIZE - 1) / 2
    for name, first, step in (("y", edge, -STEP_RAD), ("x", -edge, STEP_RAD)):
        file.createDimension(name, SIZE)
        axis = file.createVariable(name, "i2", (name,))
        axis.set_auto_maskandscale(False)
        axis.scale_factor, axis.add_offset = np.float32(step), np.float32(first)
        axis[:] = np.arange(SIZE)
    projection = file.createVariable("goes_imager_projection", "i4", ())
    projection.setncatts(
        {
            "perspective_point_height": 35786023.0,
            "semi_major_axis": GRS80.semi_major_m,
            "semi_minor_axis": GRS80.semi_minor_m,
            "longitude_of_projection_origin": -75.0,
            "sweep_angle_axis": "x",
        }
    )


def write_scalars(file: netCDF4.Dataset) -> None:
    values = {
        "band_id": 2,
        "band_wavelength": 0.64,
        "esun": 1631.3351,
        "kappa0": np.pi / 1631.3351,
        "earth_sun_distance_anomaly_in_AU": 1.0,
    }
    for name, value in values.items():
        file.createVariable(name, "f4", ())[...] = value


def write_image(file: netCDF4.Dataset) -> None:
    options = {"zlib": True, "complevel": 1, "chunksizes": (CHUNK, CHUNK)}
    image = file.createVariable("Rad", "i2", ("y", "x"), fill_value=FILL, **options)
    image.set_auto_maskandscale(False)
    image.scale_factor, image.add_offset = np.float32(SCALE), np.float32(OFFSET)
    flags = file.createVariable("DQF", "i1", ("y", "x"), fill_value=-1, **options)
    flags.set_auto_maskandscale(False)
    rng = np.random.default_rng(0)
    wave = 1500 + 1200 * np.sin(np.arange(SIZE) / 300)
    for row in range(0, SIZE, CHUNK):
        noise = rng.normal(0, 20, (CHUNK, SIZE))
        image[row : row + CHUNK] = np.clip(wave + noise, 0, FILL - 1).astype(np.int16)
        flags[row : row + CHUNK] = np.zeros((CHUNK, SIZE), np.int8)


if __name__ == "__main__":
    main()
