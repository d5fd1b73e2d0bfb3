"""The figures of a validation, SVG as data URIs."""

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

from cloudjax_fit import figures
from cloudjax_fit.figures import AFTER, BEFORE, FAINT, INK, Curve
from cloudjax_fit.histogram import sample_of

from .cover import KINDS, Covers
from .isccp import DEPTHS, FINE_DEPTHS, FINE_TOPS_HPA, TOPS_HPA, TYPES, CloudTypes
from .spectra import SHALLOW, STEEP, RowSpectrum
from .validation import SplitBand


def latitude_figure(covers: Covers) -> str:
    """Draw each cover by latitude, that of the image beside that of the analysis."""
    middles = [(b.south_deg + b.north_deg) / 2 for b in covers.by_latitude]
    with matplotlib.rc_context(figures.STYLE):
        figure = Figure(figsize=(8.4, 3.4), layout="constrained")
        for axes, kind in zip(
            figure.subplots(1, len(KINDS), sharey=True), KINDS, strict=True
        ):
            pairs = [b.covers[kind] for b in covers.by_latitude]
            axes.plot(
                [100 * p.told for p in pairs],
                middles,
                color=FAINT,
                linewidth=3,
                label="analysis",
            )
            axes.plot(
                [100 * p.image for p in pairs],
                middles,
                color=AFTER.color,
                marker="o",
                markersize=3.5,
                linewidth=1.4,
                label="image",
            )
            axes.set_xlim(0, 100)
            axes.set_ylim(-90, 90)
            axes.set_yticks(np.arange(-90, 91, 30))
            axes.set_title("all cloud" if kind == "total" else f"{kind}, as seen")
            axes.set_xlabel("cover (%)")
            if kind == KINDS[0]:
                axes.set_ylabel("latitude (degrees north)")
                figure.legend(loc="outside lower center", ncols=2)
        return figures.svg_uri(figure)


def types_figure(types: CloudTypes) -> str:
    """Draw the joint histogram of optical depth and top pressure, with nine boxes."""
    rows, columns = types.fine.shape
    with matplotlib.rc_context(figures.STYLE):
        figure = Figure(figsize=(5.2, 3.8), layout="constrained")
        axes = figure.subplots()
        drawn = axes.pcolormesh(
            np.arange(columns + 1),
            np.arange(rows + 1),
            np.ma.masked_equal(types.fine, 0),
            cmap="Blues",
            vmin=0,
            edgecolors="#ffffff",
            linewidth=0.5,
        )
        axes.invert_yaxis()
        axes.set_xticks(range(columns + 1), [f"{d:g}" for d in FINE_DEPTHS])
        axes.set_yticks(range(rows + 1), [f"{p:g}" for p in FINE_TOPS_HPA])
        down = [0, *(FINE_TOPS_HPA.index(p) for p in TOPS_HPA[1:-1]), rows]
        right = [*(FINE_DEPTHS.index(d) for d in DEPTHS[:-1]), columns]
        for at in down[1:-1]:
            axes.axhline(at, color=INK, linewidth=1)
        for at in right[1:-1]:
            axes.axvline(at, color=INK, linewidth=1)
        for i, names in enumerate(TYPES):
            for j, name in enumerate(names):
                axes.text(
                    right[j] + 0.08,
                    down[i] + 0.3,
                    name,
                    fontsize=7.5,
                    bbox={"facecolor": "#ffffffc0", "edgecolor": "none", "pad": 1},
                )
        axes.set_xlabel("optical depth")
        axes.set_ylabel("pressure at the top (hPa)")
        figure.colorbar(drawn, ax=axes, label="cover (%)")
        return figures.svg_uri(figure)


def split_figure(band: SplitBand) -> str | None:
    """Draw the histograms of clear and of cloudy pixels; None without any."""
    parts = [("clear", band.clear, BEFORE), ("cloudy", band.cloudy, AFTER)]
    curves = [
        Curve(f"{label}, {values.size} pixels", sample_of(values), stroke)
        for label, values, stroke in parts
        if values.size
    ]
    # The axis is that of the first.
    curves.sort(key=lambda curve: -np.ptp(curve.sample.values))
    return figures.density_figure(curves, band.words) if curves else None


def spectrum_figure(spectrum: RowSpectrum, words: str) -> str:
    """Draw a spectrum with the slopes that are observed."""
    with matplotlib.rc_context(figures.STYLE):
        figure = Figure(figsize=(5.2, 3.1), layout="constrained")
        axes = figure.subplots()
        longest, shortest = spectrum.fitted_km
        axes.axvspan(longest, shortest, color="#eef1f5", label="fitted")
        axes.loglog(
            spectrum.wavelength_km, spectrum.power, color=AFTER.color, linewidth=2
        )
        for slope, dashes, label in ((SHALLOW, "--", "−5/3"), (STEEP, ":", "−3")):
            axes.loglog(
                spectrum.wavelength_km,
                spectrum.line(slope),
                linestyle=dashes,
                color=BEFORE.color,
                linewidth=1.2,
                label=label,
            )
        axes.invert_xaxis()
        axes.set_ylim(spectrum.power.min() / 3, spectrum.power.max() * 3)
        # Plain labels at few places: powers of ten set as formulas take seconds.
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_major_formatter("{x:.0e}")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_minor_locator(NullLocator())
        axes.set_xlabel("wavelength (km)")
        axes.set_ylabel(f"power of the {words}")
        axes.legend()
        return figures.svg_uri(figure)
