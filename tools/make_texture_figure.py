"""Draw docs/images/texture.png: make_texture_figure.py FOLDER TEXTURE VALUES OUT.png

FOLDER holds the ABI files of a scene; TEXTURE and VALUES the results of `cloudjax fit`
on it, by default and with `--statistics values`.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from cloudjax_fit.band_radiances import BandRadiances
from cloudjax_fit.common_pixels import common_pixels
from cloudjax_fit.radiance_files import read_radiances
from cloudjax_fit.texture import TexturePair, texture


BANDS = (1, 3, 13)
SHADES = 32


def main(folder: str, by_texture: str, by_values: str, output: str) -> None:
    observed = read_radiances(folder)
    figure = Figure(figsize=(9, 5.4), layout="constrained")
    axes = figure.subplots(2, len(BANDS), sharex="row", sharey="row")
    for label, results, style in (
        ("radiances alone", by_values, "C1--"),
        ("texture too", by_texture, "C0-"),
    ):
        simulated = read_radiances(Path(results) / "simulated.nc")
        for column, number in zip(axes.T, BANDS, strict=True):
            pair = _pair(observed[number], simulated[number])
            scale = pair.reference
            column[0].plot(scale.wavelength, pair.power_ratio_db, style, label=label)
            column[1].plot(scale.lag, pair.increment_ratio, style, label=label)
            column[0].set_title(f"C{number:02d}", fontsize=10)
    for row, (level, name, scale) in zip(
        axes,
        (
            (0.0, "power, dB", "longest wavelength of the octave, pixels"),
            (1.0, "differences, ratio", "distance of two pixels, pixels"),
        ),
        strict=True,
    ):
        row[0].set_ylabel(f"{name}\nsimulated over observed")
        for ax in row:
            ax.axhline(level, color="0.6", linewidth=0.8)
            ax.set_xscale("log", base=2)
            ax.xaxis.set_major_formatter("{x:g}")
            ax.set_xlabel(scale, fontsize=8)
    axes[0, 0].invert_xaxis()
    axes[0, 0].legend(fontsize=8, frameon=False)
    figure.savefig(output, dpi=90)
    picture = Image.open(output).convert("RGB")
    picture.quantize(SHADES).save(output, optimize=True)


def _pair(observed: BandRadiances, simulated: BandRadiances) -> TexturePair:
    assert observed.grid is not None
    assert simulated.grid is not None
    found = common_pixels(
        observed.values, observed.grid, simulated.values, simulated.grid
    )
    assert found is not None
    known = np.isfinite(found[0]) & np.isfinite(found[1])
    one, other = (texture(image, known) for image in found)
    return TexturePair(one, other)


if __name__ == "__main__":
    main(*sys.argv[1:])
