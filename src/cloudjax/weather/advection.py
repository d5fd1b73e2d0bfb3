"""Displacement maps say where on the sphere the air at each point came from.

Schinder et al. (2024, section 2.2) displace an equirectangular grid backwards in the
wind and sample textures and masks at the upwind points. Points are unit vectors
throughout (x to 0°N 0°E, z to the north pole), so neither a pole nor the date line is
special.

What is integrated, stored and interpolated is the *displacement* p' - p, never p'
alone: float32 then loses a few 1e-7 of the displacement instead of 1e-7 of the Earth's
radius at every step, and no wind gives exactly no displacement.
"""

import abc
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float
from numpy.typing import ArrayLike

from cloudjax.geometry.angles import angles_deg, latitude_longitude_deg
from cloudjax.geometry.latlon_grid import AnyArray, LatLonGrid, Scalar, weighted_nodes
from cloudjax.workers import each

from .time_stepping import AbstractScheme, RungeKutta4


Velocity = Callable[[Float[Array, "3 points"], Float[Array, ""]], Array]

# Points that are carried at once: what they need fits the cache of a CPU core.
_AT_ONCE = 1 << 14


def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


# Component by component: of whole arrays, XLA finds each part anew for each component.


def _tangent(points, vectors):
    along = _dot(points, vectors) / _dot(points, points)
    return jnp.stack([v - p * along for p, v in zip(points, vectors, strict=True)])


def _onto_sphere(points, displacement):
    """The displacement shortened so that it ends at the distance of `points`.

    With e = (|p + d|² - |p|²)/|p|² formed from d, nothing cancels when d is small.
    Component by component.
    """
    xp = np if isinstance(displacement[0], np.ndarray) else jnp
    twice = [2 * p + d for p, d in zip(points, displacement, strict=True)]
    e = _dot(twice, displacement) / _dot(points, points)
    # the floor is reached only by a chord through the centre of the Earth
    q = xp.sqrt(xp.maximum(1 + e, 1e-6))
    less = e / (q * (1 + q))
    return [d / q - p * less for p, d in zip(points, displacement, strict=True)]


# Winds ------------------------------------------------------------------------------


class AbstractWind(eqx.Module):
    """A wind is horizontal, on a sphere of radius `radius_m`."""

    radius_m: eqx.AbstractVar[Scalar]

    @abc.abstractmethod
    def sampler(self) -> Velocity:
        """Return the wind [m/s] as a function of unit vectors [3, points] and time [s].

        It is called once before the time loop: work that all samples share belongs
        here. The result is Cartesian and tangent to the sphere, components first.
        """


def _time_axis(time_s):
    """Times as an array, which must still tell seconds apart."""
    if not isinstance(time_s, Tracer):
        exact = np.atleast_1d(np.asarray(time_s, float))
        if not np.all(np.diff(exact) > 0):
            raise ValueError("time_s must ascend strictly and hold no NaN.")
        if np.max(np.spacing(np.abs(exact).astype(jnp.result_type(float)))) > 1:
            raise ValueError(
                f"time_s reaches {exact[-1]:.4g} s, where single precision no longer "
                "tells seconds apart; count from the time of the scene."
            )
    return jnp.atleast_1d(jnp.asarray(time_s, float))


class Wind(AbstractWind):
    """A `Wind` is that of a weather analysis at one level, bilinear in space, linear in
    time.

    Components are turned into Cartesian vectors at the nodes and these are
    interpolated, so the pole, where east has no direction, is no singularity.

    Before the first and after the last analysis the wind is held constant; so it is in
    latitude beyond the outermost rows.
    """

    eastward_m_s: Float[Array, "time lat lon"]
    northward_m_s: Float[Array, "time lat lon"]
    time_s: Float[Array, " time"]
    radius_m: Scalar
    grid: LatLonGrid

    def __init__(
        self,
        eastward_m_s: Float[AnyArray, "time lat lon"],
        northward_m_s: Float[AnyArray, "time lat lon"],
        latitude_deg: ArrayLike,
        longitude_deg: ArrayLike,
        *,
        time_s: ArrayLike | Array | float = 0.0,
        radius_m: Scalar,
    ):
        """**Arguments:**

        - `eastward_m_s`, `northward_m_s`: [time, lat, lon] m/s.
        - `latitude_deg`: [lat] ascending, evenly spaced.
        - `longitude_deg`: [lon] ascending, evenly spaced, round the whole circle.
        - `time_s`: [time] of the analyses, ascending, counted from the scene.
        - `radius_m`: `geodesy.MEAN_RADIUS_M` plus the altitude of the level.

        **Raises:** `ValueError` where shapes or axes are not so, or a component is NaN.
        """
        self.eastward_m_s = jnp.asarray(eastward_m_s)
        self.northward_m_s = jnp.asarray(northward_m_s)
        self.time_s = _time_axis(time_s)
        self.radius_m = radius_m
        self.grid = LatLonGrid.from_axes(latitude_deg, longitude_deg)

    def __check_init__(self):
        shape = (self.time_s.size, *self.grid.shape)
        for name in ("eastward_m_s", "northward_m_s"):
            field = getattr(self, name)
            if field.shape != shape:
                raise ValueError(
                    f"{name} has shape {field.shape}, but its axes (time, lat, lon) "
                    f"have {shape}."
                )
            if not isinstance(field, Tracer) and not jnp.all(jnp.isfinite(field)):
                raise ValueError(f"{name} holds NaN or infinity; fill it first.")
        if not self.grid.longitude.periodic:
            raise ValueError(
                "longitude_deg of a wind must go round the whole circle: air leaves "
                "any smaller region."
            )

    def sampler(self) -> Velocity:
        """Do what `AbstractWind.sampler` says."""
        # A plane for each component: reads of one are as fast as memory.
        planes = jnp.moveaxis(self._cartesian_nodes(), -1, 0).reshape(3, -1)
        nodes = self.grid.shape[0] * self.grid.shape[1]

        def read(corners):
            return [weighted_nodes(plane, corners) for plane in planes]

        def velocity(points, time_s):
            corners = self.grid.corners(*angles_deg(*points))
            if self.time_s.size == 1:
                return _tangent(points, read(corners))
            earlier, later_weight = self._bracket(time_s)
            first, second = earlier * nodes, (earlier + 1) * nodes
            before = read([(i + first, w) for i, w in corners])
            after = read([(i + second, w) for i, w in corners])
            between = [
                b + later_weight * (a - b) for b, a in zip(before, after, strict=True)
            ]
            return _tangent(points, between)

        return velocity

    def _cartesian_nodes(self):
        phi = jnp.deg2rad(jnp.asarray(self.grid.latitude.values))[:, None]
        lam = jnp.deg2rad(jnp.asarray(self.grid.longitude.values))[None, :]
        u, v = self.eastward_m_s, self.northward_m_s
        # u e_east + v e_north; `away` points along the meridian, off the axis
        away = -v * jnp.sin(phi)[None]
        cos, sin = jnp.cos(lam)[None], jnp.sin(lam)[None]
        up = v * jnp.cos(phi)[None]
        nodes = jnp.stack([away * cos - u * sin, away * sin + u * cos, up], axis=-1)
        return self.grid.single_valued_poles(nodes)

    def _bracket(self, time_s):
        """The analysis before `time_s`, and the weight of the one after it."""
        after = jnp.searchsorted(self.time_s, time_s, side="right")
        i = jnp.clip(after - 1, 0, self.time_s.size - 2)
        weight = (time_s - self.time_s[i]) / (self.time_s[i + 1] - self.time_s[i])
        return i, jnp.clip(weight, 0, 1)


DEFAULT_SCHEME = RungeKutta4()


def _displacement(points, wind, start, duration, steps, scheme):
    """Of unit vectors [points 3], in parts on all cores where nothing is traced."""
    arguments = wind, start, duration, steps, scheme
    known = jax.tree.leaves((points, wind, start, duration))
    whole = len(points) <= _AT_ONCE or jax.default_backend() != "cpu"
    if whole or any(isinstance(leaf, Tracer) for leaf in known):
        return _carried(points.T, *arguments).T
    starts = range(0, len(points), _AT_ONCE)
    # The last part ends where the points do: all are of one size, compiled once.
    starts = [min(i, len(points) - _AT_ONCE) for i in starts]
    moved = np.empty(points.shape, points.dtype)

    def carry(i):
        part = points[i : i + _AT_ONCE].T
        moved[i : i + _AT_ONCE] = np.asarray(_carried(part, *arguments)).T

    for _ in each(starts, carry):
        pass
    return jnp.asarray(moved)


@eqx.filter_jit
def _carried(points, wind, start, duration, steps, scheme):
    velocity = wind.sampler()
    dtype = points.dtype
    start, duration, radius = (
        jnp.asarray(x, dtype) for x in (start, duration, wind.radius_m)
    )
    step = duration / steps

    def rate(displacement, time):
        return velocity(points + displacement, time).astype(dtype) / radius

    # reverse mode keeps one displacement per step and repeats the stages: a global map
    # of a million points would otherwise hold gigabytes of corner weights
    @eqx.filter_checkpoint
    def body(displacement, count):
        moved = scheme(rate, displacement, start + count * step, step)
        return jnp.stack(_onto_sphere(points, moved)), None

    counts = jnp.arange(steps, dtype=dtype)
    return jax.lax.scan(body, jnp.zeros_like(points), counts)[0]


def displace(
    points: Float[Array, "points 3"],
    wind: AbstractWind,
    *,
    start_s: Scalar,
    duration_s: Scalar,
    steps: int,
    scheme: AbstractScheme = DEFAULT_SCHEME,
) -> Float[Array, "points 3"]:
    """Carry points with the wind: dp/dt = v(p, t)/radius.

    **Arguments:**

    - `points`: unit vectors.
    - `wind`: the wind.
    - `start_s`, `duration_s`: the time of `points` and how long to carry them [s];
      a negative duration goes upwind.
    - `steps`: number of equal steps. Differentiable in both modes.
    - `scheme`: one step of the integration. Between nodes and between analyses the wind
      has kinks, so that a scheme shows its order only on a smooth wind.

    **Returns:** unit vectors.
    """
    _require_steps(steps)
    return points + _displacement(points, wind, start_s, duration_s, steps, scheme)


def _require_steps(steps):
    if steps < 1:
        raise ValueError(f"steps must be at least 1, not {steps}.")


# Maps -------------------------------------------------------------------------------


class DisplacementMap(eqx.Module):
    """A `DisplacementMap` holds the upwind points of a global grid, ready to be
    interpolated.

    - `displacement`: [lat, lon, 3] from each node to its upwind point, on the unit
      sphere. Rows run from pole to pole, columns from -180° round the circle.
    - `time_s`: the time at which the air is at the nodes.
    - `duration_s`: how long before that it was at the upwind points.
    - `grid`: the nodes.
    """

    displacement: Float[Array, "lat lon 3"]
    time_s: Float[Array, ""]
    duration_s: Float[Array, ""]
    grid: LatLonGrid

    def upwind(
        self, points: Float[AnyArray, "*points 3"]
    ) -> Float[AnyArray, "*points 3"]:
        """Return where the air at `points` came from: unit vectors to unit vectors.

        The displacement is interpolated, not the position: bilinear in latitude and
        longitude, of relative error about (grid step in radians)²/8. numpy float64
        points give float64 results, in error by the 1e-7 of the displacement that its
        storage in float32 costs. Without wind the result is exactly `points`.
        """
        return points + self.displacement_of(points)

    def displacement_of(
        self, points: Float[AnyArray, "*points 3"]
    ) -> Float[AnyArray, "*points 3"]:
        """Return `upwind` less the points, without the rounding of that difference."""
        if isinstance(self.displacement, Tracer):
            points = jnp.asarray(points)
        nodes = self.displacement
        between = self.grid.sample(nodes, *latitude_longitude_deg(points))
        return _shortened(points, between)


def _shortened(points, displacement):
    """As `_onto_sphere`, components last."""
    xp = np if isinstance(displacement, np.ndarray) else jnp
    p, d = ([array[..., i] for i in range(3)] for array in (points, displacement))
    return xp.stack(_onto_sphere(p, d), axis=-1)


def _global_grid(resolution_deg: float) -> LatLonGrid:
    rows = round(180 / resolution_deg)
    if rows < 2 or abs(rows * resolution_deg - 180) > 1e-6:
        raise ValueError(f"resolution_deg must divide 180; {resolution_deg} does not.")
    return LatLonGrid.from_axes(
        np.linspace(-90, 90, rows + 1), np.arange(2 * rows) * (180 / rows) - 180
    )


def displacement_map(
    wind: AbstractWind,
    *,
    hours: Scalar,
    time_s: Scalar = 0.0,
    resolution_deg: float = 0.5,
    steps: int = 40,
    scheme: AbstractScheme = DEFAULT_SCHEME,
) -> DisplacementMap:
    """Displace a global equirectangular grid upwind in the wind (Schinder et al. 2024,
    section 2.2).

    **Arguments:**

    - `wind`: the wind.
    - `hours`: how far back; Schinder et al. (2024) use 2 to 20. Differentiable.
    - `time_s`: the time at which the map is used [s], on the clock of the wind.
    - `resolution_deg`: grid step; must divide 180.
    - `steps`, `scheme`: as for `displace`. In a rough synthetic wind of up to 55 m/s
      on a 1° grid, 20 h (3400 km) in 40 steps were off by 5 m at the median and 120 m
      at most, and in 10 steps by 60 m and 1.6 km.
    """
    _require_steps(steps)
    grid = _global_grid(resolution_deg)
    time, duration = jnp.asarray(time_s, float), 3600 * jnp.asarray(hours, float)
    points = jnp.asarray(grid.unit_vectors(), float).reshape(-1, 3)
    moved = _displacement(points, wind, time, -duration, steps, scheme)
    return DisplacementMap(moved.reshape(*grid.shape, 3), time, duration, grid)


def propagate(
    earlier: DisplacementMap,
    wind: AbstractWind,
    *,
    duration_s: Scalar,
    steps: int = 1,
    scheme: AbstractScheme = DEFAULT_SCHEME,
) -> DisplacementMap:
    """Carry a map on to a later frame, without starting over (semi-Lagrangian).

    Every node goes back `duration_s` in the wind to where the earlier map is
    interpolated. Each frame adds one interpolation error and smooths the map a little;
    start over now and then in a long sequence.

    **Arguments:**

    - `earlier`: the map of the frame before.
    - `wind`: the wind.
    - `duration_s`: time between the frames [s], by which the map's duration grows.
    - `steps`, `scheme`: as for `displace`.
    """
    _require_steps(steps)
    grid, time = earlier.grid, earlier.time_s + duration_s
    points = jnp.asarray(grid.unit_vectors(), float).reshape(-1, 3)
    recent = _displacement(points, wind, time, -duration_s, steps, scheme)
    middle = points + recent
    before = grid.sample(earlier.displacement, *latitude_longitude_deg(middle))
    whole = _shortened(points, recent + _shortened(middle, before))
    nodes = jnp.asarray(whole).reshape(*grid.shape, 3)
    return DisplacementMap(nodes, time, earlier.duration_s + duration_s, grid)
