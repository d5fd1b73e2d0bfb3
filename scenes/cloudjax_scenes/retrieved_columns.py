"""Optical depth and top height that a satellite has seen become columns of cloud.

Water and ice are a level each, with a base and a top of its own in every column, and
what is between them is a third. The line of sight of a pixel goes through the middle of
its cloud, halfway between base and top.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from cloudjax.geometry.column_grid import ColumnGrid
from cloudjax.geometry.geostationary_map import column_grid
from cloudjax.light.bulk_extinction import extinction_m2_g
from cloudjax_data import CloudRetrieval
from cloudjax_data.condensate import Condensate

from .cloud_thickness import ICE, LEAST_M, WATER, CloudKind, is_ice
from .undone_parallax import moved, stand


# Rows and columns without cloud about all others, between which clouds end.
_MARGIN = 2
# Between the levels of water and ice, which must not touch [m].
_APART_M = 1.0


@dataclass(frozen=True, eq=False)
class RetrievedColumns:
    """`RetrievedColumns` are the clouds of a `CloudRetrieval`, standing where they are.

    Make them with `RetrievedColumns.of`. The air is the US standard atmosphere, the
    ground at sea level.

    **Fields:**

    - `retrieval`: what has been seen.
    - `grid`: where the columns are, as far apart as the pixels.
    - `heights_m`: of the levels' ends, ascending.
    - `condensate`: water, ice, or both.
    - `out_of_sight`: how many cloudy pixels have no column, for others stand there:
      slopes that fall away from the satellite hold more pixels than columns.
    """

    retrieval: CloudRetrieval
    grid: ColumnGrid
    heights_m: Float[np.ndarray, "ends y x"]
    condensate: tuple[Condensate, ...]
    out_of_sight: int
    cloud_fraction: None = None
    winds_m_s: None = None
    air: None = None

    @staticmethod
    def of(retrieval: CloudRetrieval) -> "RetrievedColumns":
        """Let the clouds stand.

        **Raises:** `DataError` where there is no cloud.
        """
        retrieval.require_cloud()
        ice = retrieval.cloudy & is_ice(np.nan_to_num(retrieval.top_m))
        image = column_grid(retrieval.grid)
        seen = [
            _Seen.of(retrieval, image, kind, cloudy)
            for kind, cloudy in ((WATER, retrieval.cloudy & ~ice), (ICE, ice))
            if cloudy.any()
        ]
        corner, grid = _covering(image, seen)
        layers = [_Layer.of(one, corner, grid.shape) for one in seen]
        heights = _heights(layers)
        return RetrievedColumns(
            retrieval=retrieval,
            grid=grid,
            heights_m=heights,
            condensate=tuple(
                layer.condensate(heights, 2 * i) for i, layer in enumerate(layers)
            ),
            out_of_sight=sum(layer.out_of_sight for layer in layers),
        )

    @property
    def time(self) -> datetime:
        """Give the middle of the scan, in UTC."""
        return self.retrieval.time

    @property
    def sources(self) -> tuple[str, ...]:
        """Give the names of the files."""
        return tuple(path.name for path in self.retrieval.paths)

    @property
    def ground_m(self) -> Float[np.ndarray, "y x"]:
        """Give the height of the ground, sea level."""
        return np.zeros(self.grid.shape)

    def require_cloud(self) -> None:
        """Raise `DataError` where there is no cloud at all."""
        self.retrieval.require_cloud()

    def cautions(self) -> list[str]:
        """Say what the files do not tell and what was put in its place."""
        return self.retrieval.cautions()


@dataclass(frozen=True, eq=False)
class _Seen:
    """Clouds of one kind on the pixels of an image, and where pixels come to stand
    among columns that are these pixels.
    """

    kind: CloudKind
    cloudy: Bool[np.ndarray, "y x"]
    optical_depth: Float[np.ndarray, "y x"]
    base_m: Float[np.ndarray, "y x"]
    top_m: Float[np.ndarray, "y x"]
    at: Float[np.ndarray, "2 y x"]

    @staticmethod
    def of(retrieval: CloudRetrieval, image: ColumnGrid, kind, cloudy) -> "_Seen":
        tau = np.where(cloudy, retrieval.optical_depth, 0.0)
        top = np.maximum(np.where(cloudy, retrieval.top_m, LEAST_M), LEAST_M)
        base = top - kind.thickness_m(tau, top)
        at = moved(retrieval.grid, image, cloudy, (base + top) / 2)
        return _Seen(kind, cloudy, tau, base, top, at)


def _covering(
    image: ColumnGrid, seen: Sequence[_Seen]
) -> tuple[Float[np.ndarray, "2"], ColumnGrid]:
    """Columns where there is cloud and some more about them, as far apart as pixels;
    and the first of them among columns that are the pixels.

    They stand so that clouds come to stand in the middles of columns as far as it can
    be: those of one height all do.
    """
    at = np.concatenate([one.at[:, one.cloudy] for one in seen], axis=1)
    # The mean of what is beyond whole columns, as angles.
    beyond = np.angle(np.exp(2j * np.pi * at).mean(axis=1)) / (2 * np.pi)
    first = np.floor(at.min(axis=1) - beyond) + beyond - _MARGIN
    rows, columns = (np.ceil(at.max(axis=1) - first) + _MARGIN + 1).astype(int)
    (x0, y0), (dx, dy) = image.first_m, image.spacing_m
    corner = (float(x0 + first[1] * dx), float(y0 + first[0] * dy))
    return first, replace(image, first_m=corner, shape=(int(rows), int(columns)))


@dataclass(frozen=True, eq=False)
class _Layer:
    """Clouds of one kind on columns; where there are none, base and top are those of
    the nearest.
    """

    kind: CloudKind
    cloudy: Bool[np.ndarray, "y x"]
    optical_depth: Float[np.ndarray, "y x"]
    base_m: Float[np.ndarray, "y x"]
    top_m: Float[np.ndarray, "y x"]
    out_of_sight: int

    @staticmethod
    def of(seen: _Seen, corner, shape: tuple[int, int]) -> "_Layer":
        standing = stand(seen.at - corner[:, None, None], seen.cloudy, shape)
        nearest = standing.nearest

        def of_columns(field):
            return field.reshape(-1)[nearest]

        return _Layer(
            kind=seen.kind,
            cloudy=standing.cloudy,
            optical_depth=np.where(standing.cloudy, of_columns(seen.optical_depth), 0),
            base_m=of_columns(seen.base_m),
            top_m=of_columns(seen.top_m),
            out_of_sight=int(
                seen.cloudy.sum() - len(np.unique(standing.pixel[standing.cloudy]))
            ),
        )

    def condensate(self, heights_m, level: int) -> Condensate:
        """What gives the columns their optical depth, all in one level."""
        shape = (len(heights_m) - 1, *self.cloudy.shape)
        radius = np.full(shape, self.kind.effective_radius_um)
        per_gram = extinction_m2_g(self.kind.phase, jnp.asarray(radius[level], float))
        deep = heights_m[level + 1] - heights_m[level]
        content = np.zeros(shape)
        content[level] = self.optical_depth / (np.asarray(per_gram, float) * deep)
        return Condensate(self.kind.phase, content, radius)


def _heights(layers: Sequence[_Layer]) -> Float[np.ndarray, "ends y x"]:
    """Base and top of each layer, the lower one first, and none of them touching.

    Where both have cloud, that below is pushed down under the other; else the one
    without cloud gives way.
    """
    if len(layers) == 1:
        return np.stack([layers[0].base_m, layers[0].top_m])
    low, high = layers
    free = low.cloudy & ~high.cloudy
    room = np.where(free, low.top_m, 2 * LEAST_M) + _APART_M
    high_base = np.maximum(high.base_m, room)
    high_top = np.maximum(high.top_m, high_base + LEAST_M)
    low_top = np.minimum(low.top_m, high_base - _APART_M)
    low_base = np.minimum(low.base_m, low_top - LEAST_M)
    return np.stack([low_base, low_top, high_base, high_top])
