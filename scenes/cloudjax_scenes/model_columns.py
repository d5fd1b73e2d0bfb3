"""Clouds that stand in columns, as the renderer and as particles take them."""

from collections.abc import Sequence
from datetime import datetime
from typing import Protocol, runtime_checkable

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from cloudjax.geometry.column_grid import ColumnGrid
from cloudjax.light.bulk_extinction import extinction_m2_g
from cloudjax.particles.placement import DepthColumns
from cloudjax_data.condensate import Condensate, LevelAir


@runtime_checkable
class CloudColumns(Protocol):
    """`CloudColumns` are clouds of one time on columns and levels.

    Those of a weather model (`cloudjax_data.WrfColumns`) and those that a satellite has
    seen (`retrieved_columns.RetrievedColumns`) are such.
    """

    @property
    def grid(self) -> ColumnGrid:
        """Say where the columns are."""
        ...

    @property
    def heights_m(self) -> Float[np.ndarray, "ends y x"]:
        """Heights of the levels' lower and upper ends above the sea, ascending."""
        ...

    @property
    def condensate(self) -> tuple[Condensate, ...]:
        """Water and ice."""
        ...

    @property
    def cloud_fraction(self) -> Float[np.ndarray, "levels y x"] | None:
        """Share of the cells that holds it; None where it fills them."""
        ...

    @property
    def winds_m_s(self) -> tuple[Float[np.ndarray, "levels y x"], ...] | None:
        """Winds to the true east, to the true north and upwards; None for none."""
        ...

    @property
    def ground_m(self) -> Float[np.ndarray, "y x"]:
        """Height of the ground."""
        ...

    @property
    def air(self) -> LevelAir | None:
        """The air; None for the US standard atmosphere over ground of 288.15 K."""
        ...

    @property
    def time(self) -> datetime:
        """The time, in UTC."""
        ...

    @property
    def sources(self) -> Sequence[str]:
        """Names of the files."""
        ...

    def require_cloud(self) -> None:
        """Raise `DataError` where there is no condensate at all."""

    def cautions(self) -> list[str]:
        """Say what is not known of the clouds and pictures of them will lack."""
        ...


def extinction_per_m(part: Condensate) -> Float[np.ndarray, "levels y x"]:
    """Find the extinction at 0.64 µm [1/m] of water, or of ice, mean over the cells."""
    radius = jnp.asarray(part.effective_radius_um, float)
    per_gram = np.asarray(extinction_m2_g(part.phase, radius), float)
    return part.content_g_m3 * per_gram


def depth_columns(columns: CloudColumns) -> DepthColumns:
    """Find the optical depth at 0.64 µm of the cells of columns.

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
