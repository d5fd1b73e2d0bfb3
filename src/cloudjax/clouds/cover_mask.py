"""A mask under which a class of cloud covers what it is asked to."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import ArrayLike

from cloudjax.geometry.latlon_grid import AnyArray, LatLonGrid
from cloudjax.weather.masks import AbstractMask

from .column_cover import ColumnCover


class CoverMask(AbstractMask):
    """A `CoverMask` holds a cover on a regular grid and is the mask that makes it.

    The cover is what is linear between the nodes, not the mask, whose values between a
    clear node and a cloudy one would leave too little cloud.

    **Fields:** `cover`: 0 to 1. `probit`, `values`, `greatest`: of a `ColumnCover`.
    """

    cover: Float[Array, "lat lon"]
    probit: Float[Array, " nodes"]
    values: Float[Array, " nodes"]
    greatest: Float[Array, ""]
    grid: LatLonGrid

    def __check_init__(self):
        if self.cover.shape != self.grid.shape:
            raise ValueError(
                f"The cover has shape {self.cover.shape}, its axes {self.grid.shape}."
            )

    @classmethod
    def of(
        cls,
        cover: Float[AnyArray, "lat lon"],
        latitude_deg: ArrayLike,
        longitude_deg: ArrayLike,
        column: ColumnCover,
    ) -> "CoverMask":
        """Make it for a cover; NaN counts as clear.

        **Arguments:** `latitude_deg`, `longitude_deg`: as for `LatLonGrid.from_axes`;
        on a grid round the whole circle, rows at ±90 are averaged. `column`: of the
        class.
        """
        grid = LatLonGrid.from_axes(latitude_deg, longitude_deg)
        known = jnp.clip(jnp.nan_to_num(jnp.asarray(cover, float)), 0.0, 1.0)
        return cls(
            grid.single_valued_poles(known[..., None])[..., 0],
            jnp.asarray(column.probit, float),
            jnp.asarray(column.mask, float),
            jnp.asarray(column.greatest, float),
            grid,
        )

    def __call__(
        self,
        latitude_deg: Float[AnyArray, "*points"],
        longitude_deg: Float[AnyArray, "*points"],
    ) -> Float[AnyArray, "*points"]:
        """Return the mask at these points [degrees]; numpy in, numpy out.

        Outside a regional grid, and between the outermost row and the pole, the cover
        of the edge is held.
        """
        cover = self.grid.sample(self.cover[..., None], latitude_deg, longitude_deg)
        column = ColumnCover(self.probit, self.values, self.greatest)
        if isinstance(cover, np.ndarray):
            probit, values = (np.asarray(x, float) for x in (self.probit, self.values))
            column = ColumnCover(probit, values, float(self.greatest))
        return column.mask_of(cover[..., 0])
