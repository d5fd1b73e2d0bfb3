"""Cover of a rendered Earth: python benchmarks/weather_cover.py GRIB

Rays look straight down on places that are spread evenly over the Earth. What the clouds
of each layer cover is compared with what the file's evidence says there: area-weighted
means, and correlations pixel by pixel and of means over boxes of equal area.
"""

import argparse
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from cloudjax import Rays, render
from cloudjax.geometry.geodesy import ecef, up
from cloudjax.geometry.latlon_grid import LatLonGrid
from cloudjax.weather.evidence import LAYERS
from cloudjax_data import sun_direction
from cloudjax_scenes.sensors import read_sensor
from cloudjax_scenes.weather_decision import evidence_of
from cloudjax_scenes.weather_evidence import SkyEvidence
from cloudjax_scenes.weather_scene import World, open_world


HEIGHT_M, PIXEL_M = 100e3, 20e3
# Of the boxes: rows from pole to pole, and columns of equal area.
ROWS, COLUMNS = 36, 72


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("grib")
    parser.add_argument("--pixels", type=int, default=16000)
    parser.add_argument("--steps", type=int, default=24)
    options = parser.parse_args()
    world = open_world([options.grib], steps=options.steps)
    latitude, longitude = _spread(options.pixels)
    told = _told(world, latitude, longitude)
    print("per cent of the Earth  file  rendered  correlation: pixels, boxes")
    for name, layers in [*((name, (name,)) for name in LAYERS), ("all", LAYERS)]:
        found = _rendered(world, layers, latitude, longitude)
        boxes = [_boxes(x, latitude, longitude) for x in (told[name], found)]
        print(
            f"{name:22} {100 * told[name].mean():5.1f} {100 * found.mean():9.1f} "
            f"{np.corrcoef(told[name], found)[0, 1]:20.2f} "
            f"{np.corrcoef(*boxes)[0, 1]:6.2f}",
            flush=True,
        )


def _spread(pixels: int) -> tuple[np.ndarray, np.ndarray]:
    """A spiral of Fibonacci: latitudes and longitudes [degrees] of equal areas."""
    i = np.arange(pixels) + 0.5
    latitude = np.degrees(np.arcsin(1 - 2 * i / pixels))
    return latitude, (180 * (1 + np.sqrt(5)) * i) % 360 - 180


def _told(world: World, latitude, longitude) -> dict[str, Float[np.ndarray, " rays"]]:
    """What the file says of each layer, and in all."""
    cube = world.series.cubes[0]
    axes = (cube.data[name].to_numpy() for name in ("latitude", "longitude"))
    grid = LatLonGrid.from_axes(*axes)

    def at(field):
        return np.asarray(grid.sample(field[..., None], latitude, longitude))[..., 0]

    covers = SkyEvidence.of(cube).covers
    told = {name: at(np.asarray(cover, float)) for name, cover in covers.items()}
    if "cover_total" in cube.data:
        return told | {"all": at(cube.data["cover_total"].to_numpy() / 100.0)}
    return told | {"all": 1 - np.prod([1 - x for x in told.values()], axis=0)}


def _rendered(world: World, layers, latitude, longitude) -> Float[np.ndarray, " rays"]:
    """Cover of the classes of some layers."""
    time = world.series.cubes[0].valid_time
    sensor = read_sensor("abi-fulldisk-10km")
    scene = world.scene([sensor.bands[13]], time, day=False)
    wanted = [
        layer
        for layer, one in zip(scene.layers, world.classes.values(), strict=True)
        if evidence_of(one).layer in layers
    ]
    origin = ecef(latitude, longitude, np.full(latitude.shape, HEIGHT_M))
    rays = Rays(origin, -up(latitude, longitude), PIXEL_M / HEIGHT_M)
    scene = replace(scene, layers=tuple(wanted))
    image = render(scene, rays, sun_direction(time), with_products=True)
    assert image.clouds is not None
    return np.asarray(image.clouds.fraction)


def _boxes(values, latitude, longitude) -> Float[np.ndarray, " boxes"]:
    """Means over boxes of equal area that hold some pixel."""
    row = np.minimum((1 - np.sin(np.radians(latitude))) / 2 * ROWS, ROWS - 1)
    column = np.minimum((longitude + 180) / 360 * COLUMNS, COLUMNS - 1)
    box = row.astype(int) * COLUMNS + column.astype(int)
    counts = np.bincount(box, minlength=ROWS * COLUMNS)
    sums = np.bincount(box, values, minlength=ROWS * COLUMNS)
    return sums[counts > 0] / counts[counts > 0]


if __name__ == "__main__":
    main()
