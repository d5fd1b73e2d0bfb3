"""Air that is carried over the sphere ends where exact solutions say."""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax.weather.advection import (
    AbstractWind,
    Velocity,
    Wind,
    displace,
    displacement_map,
    propagate,
)
from cloudjax.weather.masks import Scalar


EARTH_M = 6.37122e6
DAY_S = 86400.0
TURN_S = 12 * DAY_S


@pytest.fixture
def x64():
    with jax.enable_x64(True):
        yield


class SolidBody(AbstractWind):
    """One turn in 12 days about an axis tilted by `angle` (Williamson et al. 1992)."""

    angle: float
    radius_m: Scalar = EARTH_M

    def sampler(self) -> Velocity:
        axis = jnp.stack([-jnp.sin(self.angle), 0.0 * self.angle, jnp.cos(self.angle)])
        spin = 2 * np.pi * self.radius_m / TURN_S * axis
        return lambda points, time_s: jnp.cross(spin, points.T).T


class Stirring(AbstractWind):
    """A smooth, sheared and unsteady wind without interpolation anywhere."""

    radius_m: Scalar = EARTH_M

    def sampler(self) -> Velocity:
        a, b, c = jnp.asarray([[0.3, -0.2, 1.0], [1.0, 0.5, -0.4], [-0.2, 1.0, 0.7]])

        def velocity(points, time_s):
            shear = (b @ points)[None] * jnp.cross(c, points.T).T
            tide = jnp.sin(2 * np.pi * time_s / DAY_S)
            return 40 * jnp.cross(a, points.T).T + 60 * (1 + tide) * shear

        return velocity


def scattered(count=200, seed=0):
    p = np.random.default_rng(seed).normal(size=(count, 3))
    poles_and_date_line = [[0, 0, 1], [0, 0, -1], [-1, 0, 0], [-0.6, 0, 0.8]]
    p = np.concatenate(
        [p / np.linalg.norm(p, axis=1, keepdims=True), poles_and_date_line]
    )
    return jnp.asarray(p)


def williamson(step_deg, angle):
    """The same wind as east and north components on a grid (eqs 75 and 76)."""
    lat = np.arange(-90, 90 + step_deg / 2, step_deg)
    lon = np.arange(0, 360, step_deg)
    phi, lam = np.meshgrid(np.deg2rad(lat), np.deg2rad(lon), indexing="ij")
    u0 = 2 * np.pi * EARTH_M / TURN_S
    u = np.cos(angle) * np.cos(phi) + np.sin(angle) * np.cos(lam) * np.sin(phi)
    v = -np.sin(angle) * np.sin(lam)
    return Wind(u0 * u[None], u0 * v[None], lat, lon, radius_m=EARTH_M)


def arc(a, b):
    """Largest distance on the unit sphere."""
    return float(jnp.linalg.norm(a - b, axis=-1).max())


@pytest.mark.parametrize("degrees", [0, 45, 90])
def test_solid_rotation_returns_after_12_days(x64, degrees):
    """Geometry: rotation about an axis tilted by 0, 45, 90°, at 90° over the poles.

    Expectation: every point is back after 12 days, and antipodal in the plane of motion
    after 6. Source: Williamson et al. (1992, J. Comput. Phys. 102, 211), case 1.
    Tolerance: 2π h⁴/120 of RK4 with h = 2π/288, 1.2e-8 rad or 8 cm.
    """
    wind, points = SolidBody(angle=np.deg2rad(degrees)), scattered()
    end = displace(points, wind, start_s=0.0, duration_s=TURN_S, steps=288)
    assert arc(end, points) < 1.3e-8
    half = displace(points, wind, start_s=0.0, duration_s=TURN_S / 2, steps=144)
    axis = np.asarray([-np.sin(wind.angle), 0, np.cos(wind.angle)])
    assert arc(half, 2 * (points @ axis)[:, None] * axis[None, :] - points) < 1.3e-8


@pytest.mark.parametrize("degrees", [0, 45, 90])
def test_solid_rotation_on_a_grid_returns_within_the_interpolation_error(degrees):
    """Geometry: the same wind as u, v on a grid of 2° and 1°, in float32.

    Expectation: back after 12 days; the components agree with the Cartesian form.
    Source: Williamson et al. (1992). Tolerance: bilinear interpolation slows the wind
    by at most h²/4, hence 2π h²/4 = 4.8e-4 rad (3 km of 40 000) at 1°.
    """
    points = scattered().astype(jnp.float32)
    for step_deg in (2.0, 1.0):
        wind = williamson(step_deg, np.deg2rad(degrees))
        end = displace(points, wind, start_s=0.0, duration_s=TURN_S, steps=288)
        assert arc(end, points) < 2 * np.pi * np.deg2rad(step_deg) ** 2 / 4


def test_the_order_of_convergence_is_four(x64):
    """Geometry: two days in an unsteady, sheared wind given as a formula.

    Expectation: halving the step divides the error by 2⁴. Source: the order of the
    method. Tolerance: 0.25 in the exponent. No grid, no interpolation error.
    """
    points, wind = scattered(), Stirring()

    def end(steps):
        return displace(points, wind, start_s=0.0, duration_s=2 * DAY_S, steps=steps)

    exact = end(2000)
    coarse, fine = (arc(end(n), exact) for n in (64, 128))
    assert np.log2(coarse / fine) == pytest.approx(4, abs=0.25)


@pytest.mark.parametrize("wind", [Stirring(), SolidBody(angle=np.pi / 2)])
def test_back_and_forth_is_the_identity(x64, wind):
    """Geometry: 20 h upwind and 20 h downwind. Expectation: the start.

    Source: uniqueness of trajectories. Tolerance: 1e-9 rad, 6 mm, the error of RK4.
    """
    points = scattered()
    back = displace(points, wind, start_s=0.0, duration_s=-72e3, steps=100)
    again = displace(back, wind, start_s=-72e3, duration_s=72e3, steps=100)
    assert arc(again, points) < 1e-9
    assert arc(back, points) > 0.1


def test_back_and_forth_on_a_grid_in_float32():
    """Geometry: as above, in a wind on a 5° grid with kinks between its cells.

    Expectation: the start. Tolerance: 2e-6 rad (13 m of 3000 km): float32 and kinks.
    """
    points, wind = scattered().astype(jnp.float32), williamson(5.0, 0.7)
    back = displace(points, wind, start_s=0.0, duration_s=-72e3, steps=100)
    again = displace(back, wind, start_s=-72e3, duration_s=72e3, steps=100)
    assert arc(again, points) < 2e-6


def test_trajectories_agree_with_diffrax(x64):
    """Geometry: 20 h upwind in the unsteady wind, and in a wind on a grid.

    Expectation: the same end points. Source: diffrax, Tsit5 with tolerance 1e-11
    (1e-8 on the grid, where steps cross kinks). Tolerance: 1e-9 rad on the formula;
    2e-6 rad, 13 m of 3000 km, on the grid.
    """
    points = scattered(40)
    for wind, tight, limit in (
        (Stirring(), 1e-11, 1e-9),
        (williamson(2.0, 0.7), 1e-8, 2e-6),
    ):
        velocity = wind.sampler()

        def rate(t, p, args, velocity=velocity):
            return velocity(p.T, t).T / EARTH_M

        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(rate),  # pyright: ignore[reportArgumentType]
            diffrax.Tsit5(),
            t0=0.0,
            t1=-72e3,
            dt0=-600.0,
            y0=points,
            stepsize_controller=diffrax.PIDController(rtol=tight, atol=tight),
            max_steps=20_000,
        )
        assert solution.ys is not None
        ours = displace(points, wind, start_s=0.0, duration_s=-72e3, steps=200)
        assert arc(ours, solution.ys[0]) < limit


def test_points_stay_on_the_sphere():
    """Geometry: 12 days in one-hour steps, float32. Expectation: unit length, 3 ulp."""
    points = scattered().astype(jnp.float32)
    end = displace(points, Stirring(), start_s=0.0, duration_s=TURN_S, steps=288)
    np.testing.assert_allclose(jnp.linalg.norm(end, axis=1), 1, atol=4e-7)


def test_a_map_interpolates_the_rotation_it_stands_for(x64):
    """Geometry: 20 h of rotation over the poles, mapped at 2° and 1°.

    Expectation: `upwind` is the inverse rotation at any point, poles and date line
    included. Source: the exact rotation. Tolerance: |R - 1| h²/4, h the grid step.
    """
    angle = 2 * np.pi * 72e3 / TURN_S
    wind, points = SolidBody(angle=np.pi / 2), scattered()
    # the axis is -x: going back turns by +angle about +x
    cos, sin = np.cos(angle), np.sin(angle)
    turn = jnp.asarray([[1, 0, 0], [0, cos, -sin], [0, sin, cos]])
    errors = []
    for step_deg in (2.0, 1.0):
        upwind = displacement_map(wind, hours=20.0, resolution_deg=step_deg).upwind(
            points
        )
        errors.append(arc(upwind, points @ turn.T))
        assert errors[-1] < angle * np.deg2rad(step_deg) ** 2 / 4
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.2)


def test_the_host_gets_float64_from_a_float32_map():
    """Geometry: a float32 map of 2 h, sampled with float64 points near its nodes.

    Expectation: the map made in float64. Source: itself. Tolerance: 2e-6 of the
    displacement, 0.6 m of 280 km, where float32 positions alone are 0.4 m apart and 8
    accumulated roundings of them would be more.
    """
    points = np.asarray(scattered(500), np.float64)
    kwargs = {"hours": 2.0, "resolution_deg": 2.0, "steps": 8}
    single = displacement_map(SolidBody(angle=0.7), **kwargs).upwind(points)
    assert isinstance(single, np.ndarray)
    assert single.dtype == np.float64
    with jax.enable_x64(True):
        double = displacement_map(SolidBody(angle=0.7), **kwargs).upwind(points)
    moved = np.linalg.norm(double - points, axis=1).max()
    assert np.abs(single - double).max() < 2e-6 * moved


def test_a_propagated_map_is_the_map_of_the_longer_time(x64):
    """Geometry: 10 h mapped at 2°, then 10 frames of one hour, in the unsteady wind.

    Expectation: the map of 20 h made at once. Source: the flow property. Tolerance:
    (displacement) h²/8 for each frame's interpolation; mean far less than the maximum.
    """
    wind = Stirring()
    step = displacement_map(wind, hours=10.0, resolution_deg=2.0)
    for _ in range(10):
        step = propagate(step, wind, duration_s=3600.0, steps=4)
    once = displacement_map(wind, hours=20.0, time_s=36e3, resolution_deg=2.0, steps=80)
    assert float(step.time_s) == 36e3
    assert float(step.duration_s) == 72e3
    size = float(jnp.abs(once.displacement).max())
    error = jnp.linalg.norm(step.displacement - once.displacement, axis=-1)
    assert float(error.max()) < 10 * size * np.deg2rad(2.0) ** 2 / 8 * 4


def test_derivatives_agree_with_central_differences(x64):
    """Geometry: the wind's components and the duration, at 10 points on a 30° grid.

    Expectation: jvp = vjp = central differences. Tolerance: 1e-6 relative.
    """
    points, base = scattered(10), williamson(30.0, 0.7)

    def end(gain, hours):
        wind = Wind(
            gain * base.eastward_m_s,
            base.northward_m_s / gain,
            base.grid.latitude.values,
            base.grid.longitude.values,
            radius_m=EARTH_M,
        )
        moved = displace(points, wind, start_s=0.0, duration_s=-3600 * hours, steps=10)
        return moved.sum(axis=0)

    at, h = (1.1, 5.0), 1e-5
    forward = jax.jit(jax.jacfwd(end, argnums=(0, 1)))(*at)
    reverse = jax.jit(jax.jacrev(end, argnums=(0, 1)))(*at)
    central = (
        (end(at[0] + h, at[1]) - end(at[0] - h, at[1])) / (2 * h),
        (end(at[0], at[1] + h) - end(at[0], at[1] - h)) / (2 * h),
    )
    for one, other, difference in zip(forward, reverse, central, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(one, difference, rtol=1e-6, atol=1e-9)


def test_compiled_forward_and_reverse_derivatives_agree_in_float32():
    """Geometry: 2500 points, 20 steps. Expectation: jit(jacfwd) = jit(jacrev).

    Tolerance: 1e-4 relative, float32 sums over 2500 points.
    """
    points, wind = scattered(2500).astype(jnp.float32), williamson(5.0, 0.7)
    weights = jnp.asarray(
        np.random.default_rng(3).normal(size=points.shape), jnp.float32
    )

    def loss(hours):
        moved = displace(points, wind, start_s=0.0, duration_s=-3600 * hours, steps=20)
        return (weights * moved).sum()

    forward = jax.jit(jax.jacfwd(loss))(20.0)
    reverse = jax.jit(jax.jacrev(loss))(20.0)
    np.testing.assert_allclose(forward, reverse, rtol=1e-4)
