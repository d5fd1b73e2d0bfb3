"""Fits of trades that nobody has made."""

from collections.abc import Mapping

from cloudjax_fit.trade.fronts import FitFront
from cloudjax_fit.trade.measured import MeasuredFits
from cloudjax_fit.trade.outline import FitKind, FitOutline
from cloudjax_fit.trade.quality import FitQuality
from cloudjax_fit.trade.trial import Estimated, Fitted
from cloudjax_scenes.trade.machine import Machine


KIND = FitKind("physical", "texture")
OUTLINE = FitOutline(KIND, (13,), pixels=1000, starts=1)


def made_up_fit(
    quality: FitQuality,
    value: float = 2.0,
    *,
    solve_s: float = 1.0,
    other_s: float = 0.0,
    compiled_s: float = 9.0,
    estimates: Mapping[str, Estimated] | None = None,
) -> Fitted:
    """A fit of one parameter, known to 0.5, unless others are given."""
    known = {"low.top": Estimated(value, 0.5, log=False, determined=True)}
    return Fitted(
        quality=quality,
        state="converged",
        solver_steps=7,
        seconds=solve_s + other_s,
        solve_s=solve_s,
        compiled_s=compiled_s,
        w1_over_std={13: 0.1},
        estimates=dict(estimates or known),
    )


REFERENCE = made_up_fit(FitQuality(16384, 48), solve_s=90.0)
# Off by 0.25, 0.5, 2 and 3 deviations; another is slower than the second and no better.
FITS = (
    made_up_fit(FitQuality(8192, 24), 2.125, solve_s=20.0, other_s=10.0),
    made_up_fit(FitQuality(4096, 12), 2.25, solve_s=6.0, other_s=10.0),
    made_up_fit(FitQuality(8192, 6), 2.5, solve_s=8.0, other_s=10.0),
    made_up_fit(FitQuality(2048, 12), 3.0, solve_s=3.0, other_s=10.0),
    made_up_fit(FitQuality(1024, 12), 3.5, solve_s=1.0, other_s=10.0),
)


def made_up_front(
    kind: FitKind = KIND,
    fits: tuple[Fitted, ...] = FITS,
    *,
    work_s: float | None = None,
) -> FitFront:
    """A front of these fits, by default on a machine as fast as this one."""
    trials = tuple(one.against(REFERENCE) for one in fits)
    outline = FitOutline(kind, OUTLINE.bands, OUTLINE.pixels, OUTLINE.starts)
    speed = Machine.here().work_s if work_s is None else work_s
    scene = MeasuredFits("a scene", outline, REFERENCE, trials)
    return FitFront(kind, Machine("2 cores", speed), scene)
