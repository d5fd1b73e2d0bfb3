"""The clouds of a weather model, as the renderer and as particles take them."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from cloudjax.light.bulk_extinction import extinction_m2_g
from cloudjax.particles.placement import DepthColumns
from cloudjax_data import WrfColumns
from cloudjax_data.condensate import Condensate


def extinction_per_m(part: Condensate) -> Float[np.ndarray, "levels y x"]:
    """Find the extinction at 0.64 µm [1/m] of water, or of ice, mean over the cells."""
    radius = jnp.asarray(part.effective_radius_um, float)
    per_gram = np.asarray(extinction_m2_g(part.phase, radius), float)
    return part.content_g_m3 * per_gram


def depth_columns(columns: WrfColumns) -> DepthColumns:
    """Find the optical depth at 0.64 µm of the cells of a model.

    **Raises:** `DataError` where there is no cloud.
    """
    columns.require_cloud()
    parts = [(p.phase == "ice", extinction_per_m(p)) for p in columns.condensate]
    extinction = np.sum([per_m for _, per_m in parts], axis=0)
    frozen = np.sum([ice * per_m for ice, per_m in parts], axis=0)
    share = frozen / np.where(extinction > 0, extinction, 1)
    depth = extinction * np.diff(columns.heights_m, axis=0)
    winds = columns.winds_m_s
    velocity = None if winds is None else np.stack(winds)
    return DepthColumns(columns.grid, columns.heights_m, depth, velocity, share)
