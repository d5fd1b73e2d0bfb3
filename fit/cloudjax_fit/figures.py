"""The figures of a report, as data URIs that need no file beside the page.

Only matplotlib's object interface is used: no backend is chosen for the process, no
window opens, and nothing is left behind in `pyplot`.
"""

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import matplotlib
import numpy as np
from jaxtyping import Float, Num
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator, StrMethodFormatter

from cloudjax_scenes.display import Display

from .histogram import Sample
from .texture import Texture


INK = "#22262b"
FAINT = "#8a9099"
FILL = "#c3c8ce"
N_BINS = 60
THUMBNAIL = 500

STYLE: dict[Any, Any] = {
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "axes.labelsize": 9,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "font.family": "sans-serif",
    "font.size": 9,
    "legend.fontsize": 8.5,
    "legend.frameon": False,
    # Text stays text: sharper, smaller and searchable. The salt and the missing date
    # make the same figures give the same bytes.
    "svg.fonttype": "none",
    "svg.hashsalt": "cloudjax",
    "text.color": INK,
    "xtick.color": FAINT,
    "xtick.labelcolor": INK,
    "ytick.color": FAINT,
    "ytick.labelcolor": INK,
}


@dataclass(frozen=True)
class Stroke:
    """A `Stroke` says how one sample is drawn in every figure. Dashes tell lines apart
    in grey.
    """

    color: str
    dashes: str = "-"
    width: float = 1.6
    filled: bool = False


REFERENCE = Stroke("#7d858f", filled=True, width=1.0)
BEFORE = Stroke("#c4662b", dashes="--")
AFTER = Stroke("#1d5fa6", width=2.0)


@dataclass(frozen=True, eq=False)
class Curve:
    """One sample under the name and the stroke that it has in the figures."""

    label: str
    sample: Sample
    stroke: Stroke


def density_figure(curves: Sequence[Curve], label: str) -> str:
    """Draw histograms of the curves, each of unit area, as an SVG data URI.

    The first curve is the reference: the axis covers it, and follows the others only
    as far again beyond it. What lies outside is stated in the legend. `label` is of the
    axis, with units.
    """
    low, high = _common_range(curves)
    edges = np.linspace(low, high, N_BINS + 1)
    with matplotlib.rc_context(STYLE):
        figure, axes = _figure()
        for curve in curves:
            _draw_density(axes, curve, edges)
        axes.set_xlabel(label)
        axes.set_ylabel("density (1 / unit)")
        axes.set_xlim(low, high)
        axes.set_ylim(bottom=0)
        axes.legend(loc="upper right")
        return svg_uri(figure)


def difference_figure(curves: Sequence[Curve], label: str) -> str:
    """Draw the cumulative fraction of each curve less that of the first, as an SVG data
    URI.

    The area between a line and zero is its 1-Wasserstein distance. The axis is scaled
    for the last curve, the fit; how far another one leaves it is in the legend.
    """
    low, high = _common_range(curves)
    radiance = np.linspace(low, high, 400)
    reference = curves[0].sample.cdf(radiance)
    differences = [(c, c.sample.cdf(radiance) - reference) for c in curves[1:]]
    reach = _reach([difference for _, difference in differences])
    with matplotlib.rc_context(STYLE):
        figure, axes = _figure()
        axes.axhline(0, color=FAINT, linewidth=0.8)
        for curve, difference in differences:
            label = _with_extreme(curve.label, difference, reach)
            axes.plot(radiance, difference, label=label, **_line(curve.stroke))
        axes.set_xlabel(label)
        axes.set_ylabel(f"CDF − CDF of {curves[0].label}")
        axes.set_xlim(low, high)
        axes.set_ylim(-reach, reach)
        if len(curves) > 1:
            axes.legend(loc="upper right")
        return svg_uri(figure)


def images_figure(
    images: Sequence[tuple[str, Num[np.ndarray, "_ _"]]], display: Display
) -> str:
    """Draw titled images side by side on one common scale, as a PNG data URI.

    Pixels that are not finite are left in a pale blue that no image contains. The scale
    spans the 0.5 to 99.5 percentiles of all images together.
    """
    thumbnails = [(title, _thumbnail(image)) for title, image in images]
    low, high = _common_scale([image for _, image in thumbnails])
    with matplotlib.rc_context(STYLE):
        height = 3.1 * max(_aspect(image) for _, image in thumbnails)
        size = (3.1 * len(images) + 0.9, min(max(height, 1.5), 4.5) + 0.3)
        figure = Figure(figsize=size, layout="compressed")
        row = figure.subplots(1, len(images), squeeze=False)[0]
        shades = matplotlib.colormaps[display.colormap].with_extremes(bad="#dbe6f2")
        drawn = None
        for axes, (title, image) in zip(row, thumbnails, strict=True):
            masked = np.ma.masked_invalid(image)
            drawn = axes.imshow(masked, cmap=shades, vmin=low, vmax=high)
            axes.set_title(title, fontsize=10)
            axes.set_xticks([])
            axes.set_yticks([])
        if drawn is not None:
            figure.colorbar(drawn, ax=list(row), label=display.label, fraction=0.05)
        return _png_uri(figure)


def texture_figure(textures: Sequence[tuple[str, Texture]], units: str) -> str:
    """Draw spectra and increments of images, as an SVG data URI."""
    strokes = [replace(REFERENCE, width=3.0), AFTER]
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(8.4, 3.1), layout="constrained")
        left, right = figure.subplots(1, 2)
        for (label, one), stroke in zip(textures, strokes, strict=False):
            left.loglog(one.wavelength, one.power, label=label, **_line(stroke))
            right.loglog(one.lag, one.increment, label=label, **_line(stroke))
        left.set_xlabel("longest wavelength of the octave (pixels)")
        left.set_ylabel(f"power ({units})²")
        left.invert_xaxis()
        right.set_xlabel("distance of two pixels (pixels)")
        right.set_ylabel(f"mean difference ({units})")
        for axes in (left, right):
            axes.xaxis.set_major_locator(LogLocator(base=2))
            axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
            axes.xaxis.set_minor_locator(NullLocator())
            axes.legend()
        return svg_uri(figure)


def history_figure(losses: Sequence[float | int | np.floating]) -> str:
    """Draw the loss after each step on a logarithmic scale, as an SVG data URI."""
    loss = np.asarray(losses, float)
    # A loss of zero, or one that is not finite, has no place on the axis.
    loss = np.where(np.isfinite(loss) & (loss > 0), loss, np.nan)
    with matplotlib.rc_context(STYLE):
        figure, axes = _figure()
        axes.plot(np.arange(loss.size), loss, marker=".", **_line(AFTER))
        if np.isfinite(loss).any():
            axes.set_yscale("log")
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.set_xlabel("step")
        axes.set_ylabel("loss")
        return svg_uri(figure)


def _figure() -> tuple[Figure, Axes]:
    # Close to the width of a telephone, so that labels stay legible when scaled to it.
    figure = Figure(figsize=(5.2, 3.1), layout="constrained")
    return figure, figure.subplots()


def _line(stroke: Stroke) -> dict:
    return {
        "color": stroke.color,
        "linestyle": stroke.dashes,
        "linewidth": stroke.width,
    }


def _common_range(curves: Sequence[Curve]) -> tuple[float, float]:
    ends = [(c.sample.quantile(0.001), c.sample.quantile(0.999)) for c in curves]
    first_low, first_high = ends[0]
    margin = (first_high - first_low) or abs(first_high) or 1.0
    low = max(min(low for low, _ in ends), first_low - margin)
    high = min(max(high for _, high in ends), first_high + margin)
    return low - 0.03 * margin, high + 0.03 * margin


def _reach(differences: Sequence[np.ndarray]) -> float:
    extremes = [float(np.abs(difference).max()) for difference in differences]
    return max(0.05, 1.1 * min(max(extremes), 4 * extremes[-1])) if extremes else 1.0


def _with_extreme(label: str, difference: np.ndarray, reach: float) -> str:
    extreme = difference[np.abs(difference).argmax()]
    return f"{label} (up to {extreme:+.2f})" if abs(extreme) > reach else label


def _draw_density(axes: Axes, curve: Curve, edges: Float[np.ndarray, " edges"]) -> None:
    sample, stroke = curve.sample, curve.stroke
    counts, _ = np.histogram(sample.values, edges, weights=sample.weights)
    total = sample.weights.sum()
    outside = 1 - counts.sum() / total
    label = curve.label + (f" ({outside:.0%} off the axis)" if outside > 0.01 else "")
    density = counts / total / np.diff(edges)
    look = {"fill": True, "color": FILL} if stroke.filled else _line(stroke)
    axes.stairs(density, edges, label=label, **look)


def _thumbnail(image: Num[np.ndarray, "_ _"]) -> Float[np.ndarray, "_ _"]:
    factor = -(-max(image.shape) // THUMBNAIL)
    rows, columns = (max(n // factor, 1) for n in image.shape)
    image = np.asarray(image, float)[: rows * factor, : columns * factor]
    blocks = image.reshape(rows, -1, columns, image.shape[1] // columns)
    good = np.isfinite(blocks)
    n_good = good.sum((1, 3))
    total = np.where(good, blocks, 0.0).sum((1, 3))
    return np.where(n_good > 0, total / np.maximum(n_good, 1), np.nan)


def _aspect(image: np.ndarray) -> float:
    return image.shape[0] / image.shape[1]


def _common_scale(images: Sequence[np.ndarray]) -> tuple[float, float]:
    finite = np.concatenate([image[np.isfinite(image)] for image in images])
    if finite.size == 0:
        return 0.0, 1.0
    low, high = np.percentile(finite, [0.5, 99.5])
    return float(low), float(high)


def svg_uri(figure: Figure) -> str:
    """Return a figure as SVG in a data URI."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    return _uri("image/svg+xml", buffer)


def _png_uri(figure: Figure) -> str:
    buffer = io.BytesIO()
    # Images of unlike shapes leave wide margins, which "tight" cuts off.
    figure.savefig(
        buffer, format="png", dpi=130, bbox_inches="tight", metadata={"Software": None}
    )
    return _uri("image/png", buffer)


def _uri(kind: str, buffer: io.BytesIO) -> str:
    return f"data:{kind};base64,{base64.b64encode(buffer.getvalue()).decode()}"
