"""Clouds on a regular grid: fields of test cases, of large-eddy simulations."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.ndimage import map_coordinates
from jaxtyping import Array, Float

from cloudjax.geometry.footprint import POINT, Footprint
from cloudjax.geometry.geodesy import east_north_up, ecef
from cloudjax.geometry.path import Path, Profile, device_array, navigate
from cloudjax.geometry.rays import Rays
from cloudjax.geometry.shells import Chords, Shell

from .source import AbstractCloudSource, Occupancy, Slopes


class GriddedPath(eqx.Module):
    """A ray's way through a grid, level coordinates in cells.

    **Fields:**

    - `path`: the geometry.
    - `entry`: east and north of the grid's corner.
    - `per_m`: how they change along the way.
    """

    path: Path
    entry: Float[Array, "rays 2"]
    per_m: Float[Array, "rays 2"]


class GriddedSamples(eqx.Module):
    """The grid's values along the rays."""

    path: Path
    density: Profile
    up: Float[Array, "3 rays steps"] | None
    gradient: Float[Array, "3 rays steps"] | None

    def on(self, path: Path, at: Float[Array, "rays points"]) -> "GriddedSamples":
        """Those at parts of the chord, 0 to 1, as if of the steps of another path."""
        return GriddedSamples(path, Profile(self.density.at(at)), None, None)


class GriddedCloud(AbstractCloudSource):
    """Cloud on a regular grid over the plane that touches the Earth in one place.

    Values are those of the cells' centres, linear in between, and nought beyond the
    grid if it is not periodic. What a pixel does not resolve is not known: pixels
    should be no wider than the cells.

    **Fields:**

    - `density`: extinction over that of the layer, by cells east, north and up; they
      divide the shell evenly.
    - `shell`: from the bottom of the lowest cells to the top of the highest.
    - `corner_deg`: latitude and longitude of the south-western corner.
    - `spacing_m`: of the cells, east and north.
    - `periodic`: whether the grid goes on on its other side.
    """

    density: Float[Array, "x y z"]
    shell: Shell = eqx.field(static=True)
    corner_deg: tuple[float, float] = eqx.field(static=True)
    spacing_m: tuple[float, float] = eqx.field(static=True)
    periodic: bool = eqx.field(static=True, default=False)

    def make_textures(self, footprint: Footprint, resolution: int) -> tuple[Array]:
        """The grid as it is, whatever the footprint."""
        return (self.density,)

    def navigate(
        self,
        rays: Rays,
        chord: Chords,
        mask=None,
        displacements=None,
        *,
        knots: int = 2,
        footprint: Footprint = POINT,
    ) -> GriddedPath:
        if mask is not None or displacements is not None:
            raise ValueError("Gridded cloud is where its grid says: no masks, no wind.")
        latitude, longitude = (np.array([degrees]) for degrees in self.corner_deg)
        corner = ecef(latitude, longitude, np.zeros(1))
        axes = self._axes[:2] / np.array(self.spacing_m)[:, None]
        entry = (rays.at(chord.entry_m) - corner) @ axes.T
        if self.periodic:
            entry = entry % self.density.shape[:2]
        return GriddedPath(
            path=navigate(rays, chord),
            entry=device_array(entry),
            per_m=device_array(rays.direction @ axes.T),
        )

    def likelihood(self, way: GriddedPath | GriddedSamples) -> Float[Array, " rays"]:
        return jnp.where(way.path.length_m > 0, 1.0, 0.0)

    def sample(
        self,
        way: GriddedPath,
        textures: tuple[Array],
        *,
        steps: int,
        with_gradient: bool,
    ) -> GriddedSamples:
        distance = way.path.distance_m(steps)
        altitude = way.path.altitude_m(distance)
        level = way.entry.T[..., None] + way.per_m.T[..., None] * distance[None]
        height = (altitude - self.shell.bottom_m) / self._spacings_m[2]
        cells = jnp.concatenate([level, height[None]])
        read = lambda cells: self._read(textures[0], cells)  # noqa: E731
        gradient = None
        if with_gradient:
            density, pull = jax.vjp(read, cells)
            (per_cell,) = pull(jnp.ones_like(density))
            axes = self._axes / self._spacings_m[:, None]
            gradient = jnp.einsum("crs,ca->ars", per_cell, jnp.asarray(axes, float))
        else:
            density = read(cells)
        return GriddedSamples(
            path=way.path,
            density=Profile(density),
            up=way.path.up(distance) if with_gradient else None,
            gradient=gradient,
        )

    def branch(
        self,
        way: GriddedPath,
        distance_m: Float[Array, " rays"],
        direction: Float[Array, "3"],
        ends_m: Float[Array, "rays ends"],
    ) -> GriddedPath:
        per_m = jnp.asarray(self._axes / self._spacings_m[:, None], float)[:2]
        turned = jnp.sum(per_m * direction[None], axis=-1)[None]
        start = way.entry + way.per_m * distance_m[:, None]
        return GriddedPath(
            path=way.path.branch(distance_m, direction, ends_m),
            entry=start,
            per_m=jnp.broadcast_to(turned, start.shape),
        )

    def occupancy(self, samples: GriddedSamples, steps: int) -> Occupancy:
        density, slopes = samples.density.in_steps(steps), None
        if samples.gradient is not None and samples.up is not None:
            none = jnp.zeros_like(density)
            slopes = Slopes(samples.gradient, none, samples.up, none[:, 0])
        return Occupancy(density[None], jnp.ones(1), slopes)

    def _read(self, density, cells):
        """Trilinear between the centres of the cells, which lie half a cell inside."""
        x, y, z = cells - 0.5
        # Within the shell, the outermost half cells are as their centres.
        z = jnp.clip(z, 0, density.shape[2] - 1)
        mode = "wrap" if self.periodic else "constant"
        return map_coordinates(density, [x, y, z], order=1, mode=mode)

    @property
    def _spacings_m(self) -> Float[np.ndarray, "3"]:
        depth = self.shell.top_m - self.shell.bottom_m
        return np.array([*self.spacing_m, depth / self.density.shape[2]])

    @property
    def _axes(self) -> Float[np.ndarray, "3 3"]:
        """East, north and up at the corner, ECEF."""
        return east_north_up(*self.corner_deg)
