"""A mask under which a class of cloud covers what it is asked to."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from cloudjax.geometry.latlon_grid import AnyArray, LatLonGrid
from cloudjax.weather.masks import AbstractMask, MaskGrid

from .column_cover import ColumnCover


class CoverMask(AbstractMask):
    """A `CoverMask` knows a cover at all places and is the mask that makes it.

    The cover is what is linear between the nodes, not the mask, whose values between a
    clear node and a cloudy one would leave too little cloud.

    **Fields:** `cover`: called with latitudes and longitudes [degrees] it gives 0 to 1;
    `column`: of the class.
    """

    cover: AbstractMask
    column: ColumnCover

    @classmethod
    def of(
        cls,
        cover: Float[AnyArray, "lat lon"],
        latitude_deg: ArrayLike,
        longitude_deg: ArrayLike,
        column: ColumnCover,
    ) -> "CoverMask":
        """Make it for a cover on a regular grid; arguments as for `cover_grid`."""
        return cls(cover_grid(cover, latitude_deg, longitude_deg), column)

    def __call__(
        self,
        latitude_deg: Float[AnyArray, "*points"],
        longitude_deg: Float[AnyArray, "*points"],
    ) -> Float[AnyArray, "*points"]:
        """Return the mask at these points [degrees]; numpy in, numpy out."""
        cover, column = self.cover(latitude_deg, longitude_deg), self.column
        if isinstance(cover, np.ndarray):
            column = jax.tree.map(lambda x: np.asarray(x, float), column)
        return column.mask_of(cover)


def cover_grid(
    cover: Float[AnyArray, "lat lon"], latitude_deg: ArrayLike, longitude_deg: ArrayLike
) -> MaskGrid:
    """Hold a cover on a regular grid; NaN counts as clear.

    Outside a regional grid, and between the outermost row and the pole, the cover of
    the edge is held.

    **Arguments:** `latitude_deg`, `longitude_deg`: as for `LatLonGrid.from_axes`; on a
    grid round the whole circle, rows at ±90 are averaged.

    **Raises:** `ValueError` for a cover of another shape than its axes.
    """
    grid = LatLonGrid.from_axes(latitude_deg, longitude_deg)
    known = jnp.clip(jnp.nan_to_num(jnp.asarray(cover, float)), 0.0, 1.0)
    return MaskGrid(grid.single_valued_poles(known[..., None])[..., 0], grid)
