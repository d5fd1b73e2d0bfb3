"""Clouds in columns over an image: python benchmarks/columns.py WRFOUT

A camera straight above the middle of the columns sees all of them. CPU seconds of the
first image, with compiling, and the median of more; without and with fractal detail,
with shadows, and of particles of the same clouds, whose error is that against the
columns.
"""

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from cloudjax import Camera
from cloudjax.particles.placement import place
from cloudjax_data import open_wrf, read_wrf
from cloudjax_scenes.model_columns import CloudColumns, depth_columns
from cloudjax_scenes.model_scene import ModelWorld
from cloudjax_scenes.particle_columns import ParticleColumns
from cloudjax_scenes.particle_files import write_particles
from cloudjax_scenes.sensor_image import render_sensor
from cloudjax_scenes.sensors import read_sensor


HEIGHT_M = 36e6
BANDS = (2, 13)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("wrf")
    parser.add_argument("--place", help="LAT,LON of the middle of an ideal run")
    parser.add_argument("--pixels", type=int, default=1000)
    parser.add_argument("--width-km", type=float, default=2.0, help="of a pixel")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--particles", type=int, default=100_000)
    options = parser.parse_args()
    centre = options.place and tuple(map(float, options.place.split(",")))
    columns = read_wrf(open_wrf(options.wrf).frames[0], centre or None)
    sensor = _above(columns, options.pixels, options.width_km)
    plain = ModelWorld(columns)
    print(f"{columns.grid.shape} columns, {options.pixels}² pixels, bands {BANDS}")
    print(f"{'CPU seconds':24} first  again  RMSE/std of bands {BANDS}")
    reference = None
    for name, make in {
        "columns": lambda: plain,
        "with detail to 500 m": lambda: replace(plain, detail_m=500.0),
        "with 6 shadow steps": lambda: replace(plain, shadows=6),
        "by particles": lambda: _of_particles(columns, options.particles),
    }.items():
        first, again, seen = _timed(make(), sensor, options.repeats)
        reference = seen if reference is None else reference
        off = np.sqrt(((seen - reference) ** 2).mean((1, 2))) / reference.std((1, 2))
        print(f"{name:24} {first:5.1f} {again:6.1f}  {np.round(off, 3)}", flush=True)


def _above(columns: CloudColumns, pixels: int, width_km: float):
    grid = columns.grid
    row, column = ((n - 1) / 2 for n in grid.shape)
    latitude, longitude = (
        float(x[0]) for x in grid.places(np.array([row]), np.array([column]))
    )
    named = read_sensor("abi-fulldisk-10km", subsatellite_longitude_deg=longitude)
    half = 1e3 * width_km * pixels / 2
    camera = Camera(
        latitude_deg=latitude,
        longitude_deg=longitude,
        altitude_m=HEIGHT_M,
        azimuth_deg=0.0,
        elevation_deg=-90.0,
        field_of_view_deg=float(np.degrees(2 * np.arctan(half / HEIGHT_M))),
        rows=pixels,
        columns=pixels,
    )
    return replace(named, name="straight above", view=camera)


def _timed(world: ModelWorld, sensor, repeats: int):
    bands = sensor.choose(BANDS)

    def image():
        return render_sensor(world, sensor, bands, world.columns.time)

    first, seen = _cpu(image)
    more = [_cpu(image)[0] for _ in range(repeats)]
    values = [band.radiance for band in seen.bands()]
    return first, statistics.median(more), np.nan_to_num(np.stack(values))


def _cpu(work: Callable):
    start = time.process_time()
    result = work()
    return time.process_time() - start, result


def _of_particles(columns: CloudColumns, count: int) -> ModelWorld:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "particles.nc"
        write_particles(file, place(depth_columns(columns), count), columns.time)
        return ModelWorld(ParticleColumns.read(file))


if __name__ == "__main__":
    main()
