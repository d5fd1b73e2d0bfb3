"""Draw docs/images/light.png: make_light_figure.py FOLDER PHYSICAL PAPER OUT.png

FOLDER holds the ABI files of a scene; PHYSICAL and PAPER the results of `cloudjax fit`
on it with either light.
"""

import json
import sys
from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from PIL import Image

from cloudjax_fit.fit_inputs import read_inputs
from cloudjax_scenes.band_image import BandImage


BANDS = (3, 13)
SHADES = 48


def main(folder: str, physical: str, paper: str, output: str) -> None:
    inputs = read_inputs(folder, bands=BANDS)
    figure = Figure(figsize=(9.6, 6.6), layout="compressed")
    rows = figure.subplots(len(BANDS), 3)
    for row, number in zip(rows, BANDS, strict=True):
        imagery = inputs.target.imagery
        band, coefficients = imagery.bands[number], imagery.coefficients(number)
        pictures = [("observed", inputs.observed[number])]
        for title, results in (("physical", physical), ("paper", paper)):
            numbers = json.loads((Path(results) / "fit.json").read_text())
            distance = numbers["bands"][str(number)]["w1_fit_over_std"]
            with xr.open_dataset(Path(results) / "simulated.nc") as simulated:
                radiance = simulated[f"radiance_{band.name}"].to_numpy()
            pictures.append((f"{title}, W1/std {distance:.3f}", radiance))
        images = [
            (title, BandImage(band, coefficients, np.asarray(radiance, float)))
            for title, radiance in pictures
        ]
        low, high = np.nanpercentile(images[0][1].shown, [0.5, 99.5])
        for axes, (title, image) in zip(row, images, strict=True):
            axes.imshow(image.shown, cmap=image.display.colormap, vmin=low, vmax=high)
            axes.set(xticks=[], yticks=[], title=title)
        row[0].set_ylabel(images[0][1].title)
    figure.savefig(output, dpi=90)
    # Few shades keep a picture of noise small.
    Image.open(output).convert("RGB").quantize(SHADES).save(output, optimize=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
