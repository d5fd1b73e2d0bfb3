"""Pixels that both of two images of one area hold: missing ones say nothing."""

import numpy as np
from jaxtyping import Bool, Num

from cloudjax import FixedGrid


Image = Num[np.ndarray, "_ _"]


def common_pixels(
    a: Image, a_grid: FixedGrid, b: Image, b_grid: FixedGrid
) -> tuple[Image, Image] | None:
    """Return both images, NaN where the other one is; None unless they show one area.

    Both are on the coarser grid then, or on the first one's: fine pixels are averaged,
    for detail that one image cannot show is no difference. A coarse pixel counts if all
    fine ones in it do.
    """
    if not _same_area(a_grid, b_grid):
        return None
    if a_grid.step_rad < b_grid.step_rad:
        return _masked(a, a_grid, b, b_grid)
    b, a = _masked(b, b_grid, a, a_grid)
    return a, b


def _masked(fine: Image, fine_grid, coarse: Image, coarse_grid) -> tuple[Image, Image]:
    rows = _nearest(fine_grid.y_rad, coarse_grid.y_rad)[:, None]
    columns = _nearest(fine_grid.x_rad, coarse_grid.x_rad)[None, :]
    pixel = (rows * coarse.shape[1] + columns).ravel()
    with np.errstate(invalid="ignore", divide="ignore"):
        means = np.bincount(pixel, np.asarray(fine, float).ravel(), coarse.size)
        means /= np.bincount(pixel, minlength=coarse.size)
    means = means.reshape(coarse.shape)
    known = np.isfinite(coarse) & np.isfinite(means)
    return _where(known, means.astype(np.float32)), _where(known, coarse)


def _where(known: Bool[np.ndarray, "_ _"], values: Image) -> Image:
    return np.where(
        known, values, np.asarray(np.nan, np.result_type(values, np.float32))
    )


def _nearest(of: np.ndarray, among: np.ndarray) -> np.ndarray:
    """The index of the nearest of evenly spaced angles."""
    step = (among[-1] - among[0]) / max(len(among) - 1, 1)
    if step == 0:
        return np.zeros(len(of), int)
    return np.clip(np.round((of - among[0]) / step), 0, len(among) - 1).astype(int)


def _same_area(a: FixedGrid, b: FixedGrid) -> bool:
    slack = max(a.step_rad, b.step_rad)
    return a.same_projection_as(b) and all(
        np.allclose(
            _ends(one, step), _ends(other, other_step), rtol=0, atol=0.1 * slack
        )
        for one, step, other, other_step in (
            (a.x_rad, a.step_rad, b.x_rad, b.step_rad),
            (a.y_rad, a.step_rad, b.y_rad, b.step_rad),
        )
    )


def _ends(angles: np.ndarray, step_rad: float) -> tuple[float, float]:
    """The outer edges of the pixels."""
    return float(angles.min() - step_rad / 2), float(angles.max() + step_rad / 2)
