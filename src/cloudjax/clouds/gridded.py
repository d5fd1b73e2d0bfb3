"""Clouds stand on a regular grid: fields of test cases, of large-eddy simulations."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.ndimage import map_coordinates
from jaxtyping import Array, Float

from cloudjax.geometry.footprint import Sampling
from cloudjax.geometry.geodesy import east_north_up, ecef
from cloudjax.geometry.path import Path, Profile, device_array, navigate
from cloudjax.geometry.rays import Rays
from cloudjax.geometry.shells import Chords, Shell

from .source import AbstractCloudSource, Occupancy, Slopes


class GriddedPath(eqx.Module):
    """A `GriddedPath` is a ray's way through a grid, level coordinates in cells.

    **Fields:**

    - `path`: the geometry.
    - `entry`: east and north of the grid's corner.
    - `per_m`: how they change along the way.
    """

    path: Path
    entry: Float[Array, "rays 2"]
    per_m: Float[Array, "rays 2"]


class GriddedSamples(eqx.Module):
    """`GriddedSamples` say where in the grid rays run; the values there are parameters.

    **Fields:**

    - `path`: the geometry.
    - `cells`: positions at points of the chord: east, north and up, in cells.
    - `slopes`: whether normals will be asked.
    """

    path: Path
    cells: Float[Array, "rays 3 points"]
    slopes: bool = eqx.field(static=True)

    def on(self, path: Path, at: Float[Array, "rays points"]) -> "GriddedSamples":
        """Place them at parts of the chord, 0 to 1, as if at another path's steps."""
        axes = [Profile(self.cells[:, axis]).at(at) for axis in range(3)]
        return GriddedSamples(path, jnp.stack(axes, axis=1), slopes=False)


class GriddedCloud(AbstractCloudSource):
    """A `GriddedCloud` is cloud on a regular grid over a plane that touches the Earth.

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

    def navigate(self, rays: Rays, chord: Chords, sampling: Sampling) -> GriddedPath:
        """Lay rays over the plane of the grid, on the host in float64."""
        del sampling
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

    def likelihood(
        self, samples: GriddedPath | GriddedSamples
    ) -> Float[Array, " rays"]:
        """Count every ray that crosses the shell as one that may meet cloud."""
        return jnp.where(samples.path.length_m > 0, 1.0, 0.0)

    def sample(
        self, way: GriddedPath, textures: tuple[()], *, steps: int, slopes: bool
    ) -> GriddedSamples:
        """Find where in the grid the middles of the steps are."""
        del textures
        distance = way.path.distance_m(steps)
        altitude = way.path.altitude_m(distance)
        level = way.entry[..., None] + way.per_m[..., None] * distance[:, None]
        height = (altitude - self.shell.bottom_m) / self._spacings_m[2]
        cells = jnp.concatenate([level, height[:, None]], axis=1)
        return GriddedSamples(way.path, cells, slopes)

    def branch(
        self,
        way: GriddedPath,
        textures: tuple[()],
        distance_m: Float[Array, " rays"],
        direction: Float[Array, "rays 3"],
        ends_m: Float[Array, "rays ends"],
    ) -> GriddedPath:
        """Leave the ways in another direction."""
        del textures
        per_m = jnp.asarray(self._axes / self._spacings_m[:, None], float)[:2]
        return GriddedPath(
            path=way.path.branch(distance_m, direction, ends_m),
            entry=way.entry + way.per_m * distance_m[:, None],
            per_m=jnp.sum(per_m[None] * direction[:, None], axis=-1),
        )

    def occupancy(self, samples: GriddedSamples, steps: int) -> Occupancy:
        """Read the density along the rays; it is the share of cloud."""
        cells = jnp.moveaxis(samples.cells, 1, 0)
        if not samples.slopes:
            density, slopes = self._read(cells), None
        else:
            density, pull = jax.vjp(self._read, cells)
            (per_cell,) = pull(jnp.ones_like(density))
            axes = jnp.asarray(self._axes / self._spacings_m[:, None], float)
            gradient = jnp.einsum("crs,ca->ars", per_cell, axes)
            none = jnp.zeros((len(density), steps), density.dtype)
            up = samples.path.up(samples.path.distance_m(density.shape[-1]))
            slopes = Slopes(gradient, none, up, none[:, 0])
        fraction = Profile(density).in_steps(steps)
        return Occupancy(fraction[None], jnp.ones(1, fraction.dtype), slopes)

    def _read(
        self, cells: Float[Array, "3 rays points"]
    ) -> Float[Array, "rays points"]:
        """Trilinear between the centres of the cells, which lie half a cell inside."""
        x, y, z = cells - 0.5
        # Within the shell, the outermost half cells are as their centres.
        z = jnp.clip(z, 0, self.density.shape[2] - 1)
        mode = "wrap" if self.periodic else "constant"
        return map_coordinates(self.density, [x, y, z], order=1, mode=mode)

    @property
    def _spacings_m(self) -> Float[np.ndarray, "3"]:
        depth = self.shell.top_m - self.shell.bottom_m
        return np.array([*self.spacing_m, depth / self.density.shape[2]])

    @property
    def _axes(self) -> Float[np.ndarray, "3 3"]:
        """East, north and up at the corner, ECEF."""
        return east_north_up(*self.corner_deg)
