"""The page of a trade of fits: one picture of error against time, and tables."""

from cloudjax_scenes.html_template import html_template
from cloudjax_scenes.trade.page import picture

from .fronts import FitFront


def fit_trade_page(front: FitFront, command: str) -> str:
    """Make a page of the scene of a front that opens offline.

    **Arguments:** `command`: that fits the scene, to which rays and steps are added.
    """
    template = html_template("cloudjax_fit.trade", "page.html.jinja")
    scene = front.scene
    return template.render(
        front=front,
        scene=scene,
        picture=picture(
            scene.trials,
            scene.best,
            seconds_of="seconds of the whole fit, once compiled",
            error_of="shift of the parameters over their standard deviation, %",
        ),
        command=command,
    )
