"""Draw docs/images/goes17.png: python tools/make_readme_figure.py FOLDER FIT OUT.png

FOLDER holds the ABI files of a scene and FIT the results of `cloudjax fit` on it.
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


SHADES = 64


def main(folder: str, results: str, output: str) -> None:
    numbers = json.loads((Path(results) / "fit.json").read_text())
    bands = numbers["scene"]["bands"]
    inputs = read_inputs(folder, bands=bands)
    figure = Figure(figsize=(3 * len(bands), 7.6), layout="constrained")
    rows = figure.subplots(3, len(bands), height_ratios=(3, 3, 1.6))
    with xr.open_dataset(Path(results) / "simulated.nc") as simulated:
        weights = simulated["cloud_weight"].to_numpy().ravel()
        for column, number in enumerate(bands):
            band = inputs.target.imagery.bands[number]
            images = (inputs.observed[number], simulated[f"radiance_{band.name}"].data)
            _draw_band(rows[:, column], inputs.target, number, images, weights)
            fitted = numbers["bands"][str(number)]["w1_fit_over_std"]
            rows[2, column].set_title(f"W1/std {fitted:.3f}", fontsize=9)
    for row, name in zip(rows, ("observed", "simulated", "cloud pixels"), strict=True):
        row[0].set_ylabel(name, fontsize=10)
    rows[2, 0].legend(fontsize=8, frameon=False)
    figure.savefig(output, dpi=80)
    # Few shades keep a picture of noise small.
    picture = Image.open(output).convert("RGB")
    picture.quantize(SHADES).save(output, optimize=True)


def _draw_band(axes, target, number, images, weights) -> None:
    imagery = target.imagery

    def of(radiance):
        coefficients = imagery.coefficients(number)
        return BandImage(imagery.bands[number], coefficients, np.asarray(radiance))

    values = [of(image) for image in images]
    low, high = np.nanpercentile(values[0].shown, [0.5, 99.5])
    for ax, image in zip(axes[:2], values, strict=True):
        ax.imshow(image.shown, cmap=image.display.colormap, vmin=low, vmax=high)
        ax.set(xticks=[], yticks=[])
    axes[0].set_title(values[0].title, fontsize=10)
    # The observed cloud pixels are known by their quantiles.
    observed = of(target.quantiles[number].equal_weights()).shown
    simulated = values[1].shown.ravel()
    use = weights > 0
    first, last = np.percentile(observed, [0.1, 99.9])
    edges = np.linspace(first, last, 50)
    axes[2].hist(observed, edges, density=True, color="#c3c8ce", label="observed")
    axes[2].hist(
        simulated[use],
        edges,
        weights=weights[use],
        density=True,
        histtype="step",
        color="k",
        label="simulated",
    )
    axes[2].set_yticks([])
    axes[2].set_xlabel(values[0].display.label, fontsize=8)
    axes[2].tick_params(labelsize=8)


if __name__ == "__main__":
    main(*sys.argv[1:])
