"""The page of a trade: one picture of error against time, and a table of the front."""

import base64
import io
from collections.abc import Sequence
from typing import Any

import matplotlib
from matplotlib.figure import Figure

from cloudjax_scenes.html_template import html_template

from .fronts import Front


_INK, _FAINT, _LINE = "#22262b", "#8a9099", "#1d5fa6"
_RC: dict[Any, Any] = {
    "axes.spines.right": False,
    "axes.spines.top": False,
    "font.size": 9,
    "svg.fonttype": "none",
    "svg.hashsalt": "cloudjax",
}
# Of an error, for a logarithmic axis.
_LEAST = 1e-5


def trade_page(front: Front, command: str) -> str:
    """Make a page of the scene of a front that opens offline.

    **Arguments:** `command`: that renders the scene, to which a quality's options are
    added.
    """
    template = html_template("cloudjax_scenes.trade", "page.html.jinja")
    (scene,) = front.scenes
    return template.render(
        front=front,
        scene=scene,
        picture=picture(
            scene.trials,
            scene.best,
            seconds_of=f"seconds for {scene.outline.pixels} pixels, once compiled",
            error_of="RMSE over standard deviation, worst band, %",
        ),
        command=command,
    )


def picture(
    trials: Sequence[Any], best: Sequence[Any], *, seconds_of: str, error_of: str
) -> str:
    """Draw error against seconds, as a data URI: all trials, and the front as a line.

    **Arguments:** `trials`, `best`: with `seconds`, `error` and `quality.words`, such
    as a `Trial`; the others label the axes.
    """
    with matplotlib.rc_context(_RC):
        figure = Figure(figsize=(8.2, 4.6), layout="constrained")
        axes = figure.subplots()
        axes.scatter(*_places(trials), s=18, color=_FAINT, label="measured")
        axes.plot(*_places(best), "o-", color=_LINE, label="nothing beats")
        for trial in best:
            axes.annotate(
                trial.quality.words.replace("--", ""),
                (trial.seconds, _shown(trial)),
                xytext=(5, 4),
                textcoords="offset points",
                color=_INK,
                fontsize=7.5,
            )
        axes.set_xscale("log")
        axes.set_yscale("log")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter("{x:g}")
            axis.set_minor_formatter("{x:g}")
        axes.margins(x=0.2, y=0.1)
        axes.set_xlabel(seconds_of)
        axes.set_ylabel(error_of)
        axes.grid(visible=True, which="both", color="#eceef1", linewidth=0.6)
        axes.legend(frameon=False)
        drawn = io.BytesIO()
        figure.savefig(drawn, format="svg", metadata={"Date": None})
    return "data:image/svg+xml;base64," + base64.b64encode(drawn.getvalue()).decode()


def _shown(trial) -> float:
    return 100 * max(trial.error, _LEAST)


def _places(trials) -> tuple[list[float], list[float]]:
    return [t.seconds for t in trials], [_shown(t) for t in trials]
