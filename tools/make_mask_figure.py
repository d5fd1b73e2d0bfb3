"""Draw the four weather masks of a GFS file: tools/make_mask_figure.py GFS PNG."""

import io
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
from PIL import Image


mpl.use("Agg")
from matplotlib import pyplot as plt

from cloudjax import cloud_classes
from cloudjax_data import read_weather
from cloudjax_scenes.surface import Surface
from cloudjax_scenes.weather_analysis import Analysis


def main(gfs: Path, png: Path) -> None:
    cube = read_weather(gfs)
    analysis = Analysis(cube)
    latitude, longitude = (cube.data[k].to_numpy() for k in ("latitude", "longitude"))
    figure, panels = plt.subplots(2, 2, figsize=(10, 5.8), layout="constrained")
    for panel, (name, cloud) in zip(panels.flat, cloud_classes().items(), strict=True):
        fraction = np.nan_to_num(analysis.fractions(cloud.conditions))
        # From the date line, as maps usually are.
        west = longitude >= 180
        rolled = np.roll(fraction, west.sum(), axis=1)
        east_of = np.sort(np.where(west, longitude - 360, longitude))
        panel.imshow(
            rolled,
            extent=(east_of[0], east_of[0] + 360, latitude[0], latitude[-1]),
            origin="lower",
            cmap="gray",
            vmin=0,
            vmax=1,
            interpolation="bilinear",
        )
        _coasts(panel)
        weight = np.cos(np.radians(latitude))[:, None] * np.ones_like(fraction)
        mean = np.average(fraction, weights=weight)
        altitude = float(cloud.conditions.sampling_altitude_m)
        panel.set_title(
            f"{name.replace('_', ' ')}, {altitude:g} m: {mean:.0%} of the sky",
            fontsize=10,
        )
        panel.set_xticks(range(-180, 181, 60))
        panel.set_yticks(range(-90, 91, 30))
        panel.tick_params(labelsize=7)
        print(f"{name}: mean {mean:.3f}, largest {fraction.max():.3f}")
    figure.suptitle(f"Cloud fraction, {cube.valid_time:%Y-%m-%d %H:%M} UTC")
    _save(figure, png)


def _coasts(panel) -> None:
    latitude, longitude = np.arange(-89.75, 90, 0.5), np.arange(-179.75, 180, 0.5)
    φ, λ = np.meshgrid(latitude, longitude, indexing="ij")
    land = Surface.of().land_at(φ.ravel(), λ.ravel()).reshape(φ.shape)
    panel.contour(longitude, latitude, land, [0.5], colors="tab:orange", linewidths=0.4)


def _save(figure, png: Path) -> None:
    """With a palette: a third of the size, and greys need no more."""
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=100)
    image = Image.open(buffer).convert("RGB").quantize(64)
    image.save(png, optimize=True)
    print(f"{png}: {png.stat().st_size} bytes")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
