"""Render the pictures of docs/gallery.md: make_gallery.py GFS.grib2 FOLDER [NAME...].

Names: evidence, shear, sides, shadows, closeup, disc; by default all. The weather is of
12 UTC, so places are where it is day then.
"""

import dataclasses
import io
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from PIL import Image


mpl.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.patches import Rectangle

from cloudjax import Camera, FixedGrid, nominal_bands, weather_classes
from cloudjax_scenes.sensor_image import SensorImage, render_sensor
from cloudjax_scenes.sensors import Sensor
from cloudjax_scenes.weather_decision import AllEvidence
from cloudjax_scenes.weather_scene import World, open_world


LARGEST_BYTES = 250_000
VISIBLE, WINDOW = 2, 13
GEO_M = 35_786e3
# The eye of a low south of Africa; a cumulus bank over the Kalahari.
LOW = -51.0, 4.0
BANK = -20.0, 22.5
EDGE = -19.6, 22.9
# Cumulus off Chile, early in the morning.
MORNING = -50.5, -75.0


def disc(world: World) -> list[tuple[str, SensorImage]]:
    """The full disc of an ABI over Greenwich, in pixels of 30 km."""
    whole = FixedGrid.abi_full_disc(10.0, 0.0)
    thirds = {
        axis: getattr(whole, axis).reshape(-1, 3).mean(axis=1)
        for axis in ("x_rad", "y_rad")
    }
    coarse = dataclasses.replace(whole, **thirds)
    sensor = Sensor("abi-fulldisk", "ABI", coarse, nominal_bands())
    seen = look(world, sensor, (VISIBLE, WINDOW))
    return [("0.64 µm", seen), ("10.3 µm", seen)]


def evidence(world: World) -> list[tuple[str, SensorImage]]:
    """The same disc with clouds by all that the forecast tells."""
    classes = weather_classes()
    return disc(dataclasses.replace(world, classes=classes, decision=AllEvidence()))


def shear(world: World) -> list[tuple[str, SensorImage]]:
    """One class whose textures the wind has drawn out for ever longer."""
    sheet = world.classes["altostratus"]
    camera = looking_down(*LOW, width_m=2200e3, altitude_m=8000e3, pixels=180)
    pictures = []
    for hours in (0.0, 7.0, 13.0):
        textures = tuple(
            dataclasses.replace(t, displacement_hours=hours) for t in sheet.textures
        )
        drawn = dataclasses.replace(sheet, textures=textures)
        alone = dataclasses.replace(world, classes={"altostratus": drawn})
        pictures.append((f"{hours:g} h", look(alone, camera, (VISIBLE,))))
    return pictures


def sides(world: World) -> list[tuple[str, SensorImage]]:
    """One bank from the south, the east and from above."""
    φ, λ = EDGE
    away = 1.5
    places = {
        "from the south": (φ - away, λ),
        "from the east": (φ, λ + away / np.cos(np.radians(φ))),
    }
    views = {
        name: Camera.looking_at(
            *place,
            altitude_m=60e3,
            target_latitude_deg=φ,
            target_longitude_deg=λ,
            field_of_view_deg=30.0,
            rows=120,
            columns=180,
        )
        for name, place in places.items()
    }
    views["from above"] = Camera(φ, λ, 170e3, 0.0, -90.0, 30.0, 120, 180)
    fine = dataclasses.replace(world, steps=48)
    return [
        (name, look(fine, sensor_of(view), (VISIBLE,))) for name, view in views.items()
    ]


def shadows(world: World) -> list[tuple[str, SensorImage]]:
    """A field of cumulus under a low sun, pixels apart and with shadows."""
    view = looking_down(*MORNING, width_m=80e3, altitude_m=700e3, pixels=200)
    return [
        (name, look(dataclasses.replace(world, steps=48, shadows=n), view, (VISIBLE,)))
        for name, n in (("pixels apart", 0), ("shadows of 6 steps", 6))
    ]


def closeup(world: World) -> list[tuple[str, SensorImage]]:
    """What is within a few pixels of 10 km."""
    wide = looking_down(*BANK, width_m=400e3, altitude_m=GEO_M, pixels=40)
    near = looking_down(*BANK, width_m=60e3, altitude_m=700e3, pixels=200)
    return [
        ("400 km, pixels of 10 km", look(world, wide, (VISIBLE,))),
        ("60 km, pixels of 300 m", look(world, near, (VISIBLE,))),
    ]


FIGURES = {
    "shear": shear,
    "sides": sides,
    "shadows": shadows,
    "closeup": closeup,
    "disc": disc,
    "evidence": evidence,
}


def looking_down(
    latitude_deg: float,
    longitude_deg: float,
    *,
    width_m: float,
    altitude_m: float,
    pixels: int,
) -> Sensor:
    angle = float(np.degrees(2 * np.arctan(width_m / 2 / altitude_m)))
    place = latitude_deg, longitude_deg, altitude_m
    return sensor_of(Camera(*place, 0.0, -90.0, angle, pixels, pixels))


def sensor_of(camera: Camera) -> Sensor:
    return Sensor("camera", "camera", camera, nominal_bands())


def look(world: World, sensor: Sensor, numbers: Sequence[int]) -> SensorImage:
    return render_sensor(world, sensor, sensor.choose(numbers), world.series.times[0])


def draw(name: str, pictures: Sequence[tuple[str, SensorImage]], png: Path) -> None:
    rows, columns = pictures[0][1].sensor.view.shape
    size = 4.2 * len(pictures), 4.2 * rows / columns + 0.3
    figure, panels = plt.subplots(1, len(pictures), figsize=size, layout="compressed")
    for panel, (title, image) in zip(np.atleast_1d(panels), pictures, strict=True):
        emitted = title.startswith("10.3")
        shown = image.band(WINDOW if emitted else VISIBLE).shown
        colours = mpl.colormaps["gray_r" if emitted else "gray"]
        high = float(np.nanpercentile(shown, 99.5))
        panel.imshow(
            shown,
            cmap=colours.with_extremes(bad="#10141a"),
            vmin=float(np.nanpercentile(shown, 0.5)) if emitted else 0.0,
            vmax=high,
        )
        panel.set_title(title, fontsize=10)
        panel.set_axis_off()
    if name == "closeup":
        # 60 km of the first panel's 400, in pixels of 10 km.
        panels[0].add_patch(Rectangle((16.5, 16.5), 6, 6, fill=False, ec="black", lw=2))
    save(figure, png)


def save(figure, png: Path) -> None:
    """With a palette, of so many greys as the size allows."""
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=110)
    whole = Image.open(buffer).convert("RGB")
    for colours in (64, 32, 16):
        whole.quantize(colours).save(png, optimize=True)
        if png.stat().st_size <= LARGEST_BYTES:
            break
    print(f"{png}: {png.stat().st_size} bytes")


def main(gfs: str, folder: Path, names: Sequence[str]) -> None:
    world = open_world([gfs], decision="table1")
    for name in names or FIGURES:
        started = time.perf_counter()
        draw(name, FIGURES[name](world), folder / f"gallery_{name}.png")
        print(f"{name}: {time.perf_counter() - started:.0f} s")


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), sys.argv[3:])
