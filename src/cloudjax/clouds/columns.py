"""Clouds stand on a weather model's columns: on its map, over terrain, on its levels.

Heights are told as a part of each column, from the lower end of its lowest level with
cloud to the upper end of its highest, so that what follows the ground still does so
between columns. What is read is the optical depth from the bottom up: differences of it
are the cloud of a step whatever levels lie within, and a column's depth is exact.
"""

import abc
import functools as ft

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from cloudjax.geometry.arrays import namespace
from cloudjax.geometry.column_grid import ColumnGrid
from cloudjax.geometry.footprint import Sampling
from cloudjax.geometry.geodesy import geodetic
from cloudjax.geometry.on_host import compiled_for_many
from cloudjax.geometry.path import Profile, device_array, navigate, points_along
from cloudjax.geometry.rays import Rays
from cloudjax.geometry.shells import Chords, Shell
from cloudjax.light.bulk_extinction import extinction_m2_g

from .column_path import ColumnPath, ColumnSamples, step_ends_m
from .source import AbstractCloudSource, Occupancy, Slopes


# Heights are told apart by this much at most [m], and tables are no larger than this.
_PART_M = 100.0
_MOST = 1 << 25
# In shares of a cell below which cloud is not gathered any closer.
_LEAST_COVER = 0.05
# A row or column that no model has.
_FAR = 1e5


class AbstractColumns(AbstractCloudSource):
    """Clouds that are read from optical depths of columns, from the bottom up.

    Linear between the middles of columns; nought beyond the outermost cells. What a
    pixel does not resolve but by `cover` is not known: pixels should be no wider than
    the cells.

    **Fields:**

    - `grid`: where the columns are.
    - `extinction_per_m`: of the layer, which an occupancy of 1 has.
    """

    grid: eqx.AbstractVar[ColumnGrid]
    extinction_per_m: eqx.AbstractVar[float]

    @abc.abstractmethod
    def bounds_m(self) -> tuple[Float[Array, "y x"], Float[Array, "y x"]]:
        """Return the heights between which each column has its cloud."""

    @abc.abstractmethod
    def depths(self) -> Float[Array, "y x ends nodes"]:
        """Return optical depths from the bottom to equal parts of each column."""

    def navigate(self, rays: Rays, chord: Chords, sampling: Sampling) -> ColumnPath:
        """Lay rays over the map, on the host in float64."""
        index, nearest = _laid(rays, chord, self.grid, sampling.knots)
        return ColumnPath(
            path=navigate(rays, chord),
            index=device_array(index),
            per_m=device_array(_per_m(self.grid)[nearest]),
        )

    def likelihood(self, samples: ColumnPath | ColumnSamples) -> Float[Array, " rays"]:
        """Count rays that pass over the grid as ones that may meet cloud."""
        axis = 1 if isinstance(samples, ColumnPath) else 2
        low, high = samples.index.min(axis), samples.index.max(axis)
        last = jnp.asarray(self.grid.shape, low.dtype)[None]
        over = ((high >= -1) & (low <= last)).all(-1)
        return jnp.where(over & (samples.path.length_m > 0), 1.0, 0.0)

    def sample(
        self, way: ColumnPath, textures: tuple[()], *, steps: int, slopes: bool
    ) -> ColumnSamples:
        """Find over which columns the steps are, and between which altitudes."""
        del textures
        length = jnp.maximum(way.path.length_m, 1.0)[:, None]
        part = way.path.distance_m(steps) / length
        return ColumnSamples(
            path=way.path,
            index=way.places(part),
            ends_m=step_ends_m(way.path, steps),
            per_m=way.per_m if slopes else None,
        )

    def branch(
        self,
        way: ColumnPath,
        textures: tuple[()],
        distance_m: Float[Array, " rays"],
        direction: Float[Array, "rays 3"],
        ends_m: Float[Array, "rays ends"],
    ) -> ColumnPath:
        """Leave the ways in another direction."""
        del textures
        return way.branch(distance_m, direction, ends_m)

    def occupancy(self, samples: ColumnSamples, steps: int) -> Occupancy:
        """Take the optical depth between the ends of each step for its cloud."""
        depths, bounds = self.depths(), jnp.stack(self.bounds_m(), axis=-1)
        nodes = depths.shape[-1]
        weights = jnp.full(nodes, 1 / nodes, depths.dtype)

        def read(index, ends_m):
            return self._read(depths, bounds, index, ends_m)

        if samples.per_m is None:
            density, slopes = read(samples.index, samples.ends_m), None
        else:
            density, pull = jax.vjp(read, samples.index, samples.ends_m)
            slopes = _slopes(samples, *pull(jnp.ones_like(density) / nodes))
        fraction = [Profile(node).in_steps(steps) for node in density]
        return Occupancy(jnp.stack(fraction), weights, slopes)

    def _read(self, depths, bounds, index, ends_m) -> Float[Array, "nodes rays points"]:
        (rows, columns), parts = self.grid.shape, depths.shape[2] - 1
        row, column = index[:, 0], index[:, 1]
        inside = (jnp.abs(row - (rows - 1) / 2) <= rows / 2) & (
            jnp.abs(column - (columns - 1) / 2) <= columns / 2
        )
        cells, shares = _corners(row, column, self.grid.shape)
        # All corners in one read each: XLA compiles many reads for minutes.
        ends = jnp.sum(bounds.reshape(-1, 2)[cells] * shares[..., None], axis=0)
        low, deep = ends[..., 0], jnp.maximum(ends[..., 1] - ends[..., 0], 1.0)
        part = jnp.clip((ends_m - low[:, None]) / deep[:, None], 0, 1) * parts
        k = jnp.clip(jnp.floor(part), 0, parts - 1).astype(int)
        table = depths.reshape(-1, depths.shape[-1])
        at = cells[:, :, None] * (parts + 1) + k[None]
        below = table[at]
        depth = below + (part - k)[None, ..., None] * (table[at + 1] - below)
        between = (depth[:, :, 1] - depth[:, :, 0]) * shares[..., None]
        rise = (ends_m[:, 1] - ends_m[:, 0]) * self.extinction_per_m
        found = jnp.sum(between, axis=0) * jnp.where(inside, 1 / rise, 0.0)[..., None]
        return jnp.moveaxis(found, -1, 0)


@compiled_for_many("grid", "knots")
def _laid(rays: Rays, chord: Chords, grid: ColumnGrid, knots: int):
    """Rows and columns over which the knots are, and the number of the column nearest
    to their middle.
    """
    xp = namespace(rays.direction)
    places = xp.stack(points_along(rays, chord, knots), axis=1)
    index = xp.stack(grid.index(*geodetic(places)[:2]), axis=-1)
    index = xp.nan_to_num(index, posinf=_FAR, neginf=_FAR)
    # A way over the seam of the map, or where it is torn, is far from all columns.
    leap = xp.abs(xp.diff(index, axis=1)).max(axis=(1, 2))
    most = 10 + 5 * chord.length_m / np.abs(grid.spacing_m).min()
    index = xp.clip(index, -_FAR, _FAR)
    index = xp.where((leap > most)[:, None, None], _FAR, index)
    row, column = (
        xp.clip(xp.rint(index[..., i].mean(1)), 0, n - 1).astype(int)
        for i, n in enumerate(grid.shape)
    )
    return index, row * grid.shape[1] + column


@ft.lru_cache(maxsize=8)
def _per_m(grid: ColumnGrid) -> Float[np.ndarray, "columns 2 3"]:
    return grid.per_m().reshape(-1, 2, 3).astype(np.float32)


def _corners(row, column, shape: tuple[int, int]):
    """Numbers of the four columns about places, and their shares; held at the edge."""
    u, v = (jnp.clip(x, 0, n - 1) for x, n in zip((row, column), shape, strict=True))
    i, j = (
        jnp.clip(jnp.floor(x), 0, n - 2).astype(int)
        for x, n in zip((u, v), shape, strict=True)
    )
    u, v = u - i, v - j
    first = i * shape[1] + j
    cells = jnp.stack([first, first + 1, first + shape[1], first + shape[1] + 1])
    return cells, jnp.stack([(1 - u) * (1 - v), (1 - u) * v, u * (1 - v), u * v])


def _slopes(samples: ColumnSamples, by_index, by_ends) -> Slopes:
    level = jnp.einsum("rkp,rkc->crp", by_index, samples.per_m, precision="highest")
    path = samples.path
    up = path.up(path.distance_m(by_ends.shape[-1]))
    return Slopes(level, by_ends.sum(1), up, jnp.zeros_like(path.length_m))


class ReadyColumns(AbstractColumns):
    """Columns whose optical depths are at hand, for renders without derivatives.

    Made by `ColumnCloud.ready`, and seen alike: what `ColumnCloud` finds anew for each
    tile of an image is found once here.

    **Fields:** `table`, `bottom_m`, `top_m`: what `depths` and `bounds_m` return.
    """

    table: Float[Array, "y x ends nodes"]
    bottom_m: Float[Array, "y x"]
    top_m: Float[Array, "y x"]
    grid: ColumnGrid = eqx.field(static=True)
    shell: Shell = eqx.field(static=True)
    extinction_per_m: float = eqx.field(static=True)

    def bounds_m(self) -> tuple[Float[Array, "y x"], Float[Array, "y x"]]:
        """Return the heights between which each column has its cloud."""
        return self.bottom_m, self.top_m

    def depths(self) -> Float[Array, "y x ends nodes"]:
        """Return optical depths from the bottom to equal parts of each column."""
        return self.table


class ColumnCloud(AbstractColumns):
    """Water, or ice, on the columns of a model; make it with `ColumnCloud.of`.

    Content and radius are parameters, with derivatives. Where condensate fills a part
    of its cell only, structures of the pixel (nodes) have it or not: the cloudy part is
    the same in all levels as far as it can be (maximum overlap), and the mean over
    nodes is the cell's.

    **Fields:**

    - `content_g_m3`: mean over the cell.
    - `effective_radius_um`: of the particles.
    - `cover`: share of the cell that holds them, more than 0; one where there are none.
    - `heights_m`: of the levels' ends, ascending.
    - `level`: in which level equal parts of each column end.
    - `phase`: "water" or "ice".
    - `nodes`: structures within a pixel.
    """

    content_g_m3: Float[Array, "y x levels"]
    effective_radius_um: Float[Array, "y x levels"]
    cover: Float[Array, "y x levels"]
    heights_m: Float[Array, "y x ends"]
    level: Int[Array, "y x parts"]
    grid: ColumnGrid = eqx.field(static=True)
    shell: Shell = eqx.field(static=True)
    phase: str = eqx.field(static=True)
    extinction_per_m: float = eqx.field(static=True)
    nodes: int = eqx.field(static=True, default=1)

    @classmethod
    def of(
        cls,
        grid: ColumnGrid,
        heights_m: Float[np.ndarray, "ends y x"],
        phase: str,
        content_g_m3: Float[np.ndarray, "levels y x"],
        effective_radius_um: Float[np.ndarray, "levels y x"],
        cover: Float[np.ndarray, "levels y x"] | None = None,
        nodes: int = 4,
    ) -> "ColumnCloud":
        """Make them from a model's fields; levels without cloud are left out.

        **Arguments:**

        - `cover`: share of the cells that holds the condensate; None where it fills
          them. Where a model has condensate without cover, it fills the cell.
        - `nodes`: structures within a pixel, where some cover is in part.

        **Raises:** `ValueError` without cloud, and for heights that do not rise.
        """
        cloudy = np.flatnonzero((content_g_m3 > 0).any(axis=(1, 2)))
        if not cloudy.size:
            raise ValueError("The columns have no cloud: there is nothing to render.")
        if not (np.diff(heights_m, axis=0) > 0).all():
            raise ValueError("The heights of the levels do not rise.")
        held = slice(cloudy[0], cloudy[-1] + 1)
        heights = heights_m[cloudy[0] : cloudy[-1] + 2]
        if cover is None:
            cover = np.ones_like(content_g_m3)
        cover = np.where(cover > 0, np.clip(cover, _LEAST_COVER, 1), 1.0)
        if not ((cover < 1) & (content_g_m3 > 0)).any():
            nodes = 1
        fields = content_g_m3, effective_radius_um, cover
        content, radius, cover = (np.moveaxis(f[held], 0, -1) for f in fields)
        per_gram = np.asarray(extinction_m2_g(phase, jnp.asarray(radius, float)))
        return cls(
            content_g_m3=device_array(content),
            effective_radius_um=device_array(radius),
            cover=device_array(cover),
            heights_m=device_array(np.moveaxis(heights, 0, -1)),
            level=jnp.asarray(_levels(np.moveaxis(heights, 0, -1), nodes)),
            grid=grid,
            shell=_shell(heights),
            phase=phase,
            extinction_per_m=float((content * per_gram / cover).max()),
            nodes=nodes,
        )

    def bounds_m(self) -> tuple[Float[Array, "y x"], Float[Array, "y x"]]:
        """Return the heights between which each column has its cloud."""
        return self.heights_m[..., 0], self.heights_m[..., -1]

    def extinction(self) -> Float[Array, "y x levels"]:
        """Return the extinction at 0.64 µm [1/m], means over the cells."""
        return self.content_g_m3 * extinction_m2_g(self.phase, self.effective_radius_um)

    def column_depth(self) -> Float[Array, "y x"]:
        """Return the optical depth of each column at 0.64 µm."""
        return (self.extinction() * jnp.diff(self.heights_m)).sum(-1)

    def mean_radius_um(self) -> float:
        """Return the mean effective radius, weighted by what light sees of each."""
        seen = np.asarray(self.extinction() * jnp.diff(self.heights_m), float)
        return float((seen * np.asarray(self.effective_radius_um)).sum() / seen.sum())

    def depths(self) -> Float[Array, "y x ends nodes"]:
        """Return optical depths from the bottom to equal parts of each column."""
        layers = self.extinction() * jnp.diff(self.heights_m)
        held = layers[..., None] * self._gathered()
        # A sum to each level, of few terms: exact where a running one would round.
        none = jnp.zeros_like(held[:, :, :1])
        sums = jnp.concatenate([none, jnp.cumsum(held, axis=2)], axis=2)
        bottom, top = self.bounds_m()
        parts = self.level.shape[-1]
        at = (jnp.arange(1, parts, dtype=bottom.dtype) / parts)[None, None]
        height = bottom[..., None] + at * (top - bottom)[..., None]
        level = self.level[..., :-1, None]
        both = jnp.concatenate([self.heights_m[..., None], sums], axis=-1)
        below, above = (
            jnp.take_along_axis(both, i, axis=2, mode="clip")
            for i in (level, level + 1)
        )
        part = (height[..., None] - below[..., :1]) / (above - below)[..., :1]
        between = below + jnp.clip(part, 0, 1) * (above - below)
        between = between[..., 1:]
        return jnp.concatenate([none, between, sums[:, :, -1:]], axis=2)

    def ready(self) -> ReadyColumns:
        """Find the optical depths once, for renders of whole images."""
        bottom, top = self.bounds_m()
        return ReadyColumns(
            table=self.depths(),
            bottom_m=bottom,
            top_m=top,
            grid=self.grid,
            shell=self.shell,
            extinction_per_m=self.extinction_per_m,
        )

    def _gathered(self) -> Float[Array, "y x levels nodes"]:
        """How much denser the condensate of a cell is in each structure.

        Structure n of N is the part n/N to (n + 1)/N of the cell. It has 1/cover where
        it is all within the cover, and the mean over all is 1.
        """
        if self.nodes == 1:
            return jnp.ones_like(self.cover)[..., None]
        first = (jnp.arange(self.nodes, dtype=self.cover.dtype) / self.nodes).reshape(
            1, 1, 1, -1
        )
        cover = self.cover[..., None]
        return jnp.clip((cover - first) * self.nodes, 0, 1) / cover


def _levels(heights: Float[np.ndarray, "y x ends"], nodes: int):
    """The level in which each of equal parts of each column ends."""
    bottom, top = heights[..., :1], heights[..., -1:]
    columns = heights[..., 0].size * nodes
    most = max(_MOST // columns, 16)
    parts = int(np.clip(np.ceil((top - bottom).max() / _PART_M), 16, most))
    # Each end of a level counts from the first part on that ends no lower.
    first = np.ceil((heights - bottom) / (top - bottom) * parts - 1e-6).astype(int) - 1
    first = np.clip(first, 0, parts).reshape(-1, heights.shape[-1])
    counts = np.zeros((len(first), parts + 1), np.int16)
    np.add.at(counts, (np.arange(len(first))[:, None], first), 1)
    level = counts[:, :parts].cumsum(axis=-1, dtype=np.int32) - 1
    level = np.clip(level, 0, heights.shape[-1] - 2)
    return level.reshape(*heights.shape[:2], parts)


def _shell(heights: Float[np.ndarray, "ends y x"]) -> Shell:
    """The air that holds all columns; below sea level no further than half a km."""
    return Shell(max(float(heights[0].min()), -500.0), float(heights[-1].max()))
