import jax
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax.geometry.angles import latitude_longitude_deg
from cloudjax.weather.advection import (
    DisplacementMap,
    Wind,
    displace,
    displacement_map,
    propagate,
)


LAT, LON = np.arange(-90.0, 91.0, 10.0), np.arange(0.0, 360.0, 10.0)
RADIUS_M = 6.371e6
# poles, date line, Greenwich, nearly a pole, anywhere
HARD_SET = np.asarray(
    [
        [0, 0, 1],
        [0, 0, -1],
        [-1, 0, 0],
        [-1, -1e-12, 0],
        [1, 0, 0],
        [1e-14, 1e-14, 1],
        [1e-18, 0, -1],
        [1e-4, -1e-5, 1],
        [0.48, -0.6, 0.64],
    ]
)


def uniform(east, north, times=(0.0,)):
    shape = (len(times), LAT.size, LON.size)
    gain = 1 + np.arange(len(times))[:, None, None]
    u, v = (np.broadcast_to(gain * speed, shape) for speed in (east, north))
    return Wind(u, v, LAT, LON, time_s=np.asarray(times), radius_m=RADIUS_M)


def at(lat, lon):
    phi, lam = np.deg2rad(lat), np.deg2rad(lon)
    parts = (np.cos(phi) * np.cos(lam), np.cos(phi) * np.sin(lam), np.sin(phi))
    return jnp.asarray(np.stack(np.broadcast_arrays(*parts), axis=-1), float)


# Winds


def test_an_eastward_wind_points_east_and_a_northward_one_north():
    point = at(0.0, np.asarray([0.0, 90.0]))
    east = uniform(10.0, 0.0).sampler()(point.T, jnp.zeros(())).T
    np.testing.assert_allclose(east, [[0, 10, 0], [-10, 0, 0]], atol=1e-5)
    north = uniform(0.0, 10.0).sampler()(point.T, jnp.zeros(())).T
    np.testing.assert_allclose(north, [[0, 0, 10], [0, 0, 10]], atol=1e-5)


def test_a_wind_is_tangent_everywhere():
    points = jnp.asarray(HARD_SET, float)
    velocity = uniform(10.0, -20.0).sampler()(points.T, jnp.zeros(())).T
    np.testing.assert_allclose(jnp.sum(points * velocity, axis=1), 0, atol=1e-5)


def test_a_wind_over_the_pole_has_one_direction():
    """A flow along the 0°-180° meridian: 10 m/s in the direction of -x at the pole."""
    lam = np.deg2rad(LON)[None, None, :]
    phi = np.deg2rad(LAT)[None, :, None]
    east, north = 10 * np.sin(lam) + 0 * phi, 10 * np.cos(lam) * np.sin(phi)
    velocity = Wind(east, north, LAT, LON, radius_m=RADIUS_M).sampler()
    around = velocity(at(89.99, np.arange(0.0, 360.0, 5.0)).T, jnp.zeros(())).T
    np.testing.assert_allclose(around, [[-10, 0, 0]] * 72, atol=0.02)
    np.testing.assert_allclose(
        velocity(at(90.0, np.asarray([0.0, 77.0])).T, jnp.zeros(())).T,
        [[-10, 0, 0]] * 2,
        atol=1e-4,
    )


@pytest.mark.parametrize(
    ("time", "gain"), [(-1e5, 1), (0, 1), (1800, 1.5), (3600, 2), (9000, 2.5), (1e6, 3)]
)
def test_a_wind_is_linear_between_analyses_and_constant_outside(time, gain):
    wind = uniform(10.0, 0.0, times=(0.0, 3600.0, 14400.0))
    velocity = wind.sampler()(at(0.0, np.zeros(1)).T, jnp.asarray(float(time))).T
    np.testing.assert_allclose(velocity, [[0, 10 * gain, 0]], atol=1e-4)


def build(**changes):
    fields = {
        "eastward_m_s": np.zeros((1, LAT.size, LON.size)),
        "northward_m_s": np.zeros((1, LAT.size, LON.size)),
        "latitude_deg": LAT,
        "longitude_deg": LON,
        "radius_m": RADIUS_M,
    }
    return Wind(**(fields | changes))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"latitude_deg": LAT[::-1]}, "latitude_deg must ascend"),
        ({"latitude_deg": LAT**3 / 8100}, "equal steps"),
        ({"longitude_deg": LON / 2}, "whole circle"),
        ({"longitude_deg": np.arange(0.0, 360, 20)}, "eastward_m_s has shape"),
        ({"eastward_m_s": np.full((1, LAT.size, LON.size), np.nan)}, "holds NaN"),
        ({"time_s": [0.0, 0.0]}, "time_s must ascend"),
        ({"time_s": [1.7e9]}, "count from the time of the scene"),
    ],
)
def test_winds_that_cannot_be_sampled_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        build(**changes)


# Displacements


@pytest.mark.parametrize("x64", [False, True])
def test_no_wind_is_exactly_no_displacement(x64):
    with jax.enable_x64(x64):
        still = uniform(0.0, 0.0)
        points = jnp.asarray(np.random.default_rng(0).normal(size=(50, 3)))
        points = points / jnp.linalg.norm(points, axis=1, keepdims=True)
        end = displace(points, still, start_s=0.0, duration_s=-1e5, steps=7)
        assert jnp.array_equal(end, points)
        map_ = displacement_map(still, hours=20.0, resolution_deg=10.0, steps=7)
        map_ = propagate(map_, still, duration_s=60.0)
        assert jnp.array_equal(map_.upwind(points), points)
        assert np.array_equal(map_.upwind(np.asarray(HARD_SET)), HARD_SET)


def test_upwind_is_against_the_wind():
    map_ = displacement_map(uniform(10.0, 0.0), hours=10.0, resolution_deg=5.0)
    lat, lon = latitude_longitude_deg(map_.upwind(at(0.0, np.asarray([0.0, 180.0]))))
    westward = np.rad2deg(36e4 / RADIUS_M)
    np.testing.assert_allclose(lat, 0, atol=1e-4)
    np.testing.assert_allclose(lon, [-westward, 180 - westward], atol=0.01)


@pytest.mark.parametrize(
    "wind", [uniform(0.0, 0.0), uniform(30.0, -20.0, (0.0, 3600.0))]
)
def test_gradients_are_finite_on_the_hard_set(wind):
    points = jnp.asarray(HARD_SET, float)
    map_ = displacement_map(wind, hours=2.0, resolution_deg=10.0, steps=3)

    def moved(points, east, north, duration):
        """By the path and by the map."""
        moving = Wind(east, north, LAT, LON, time_s=wind.time_s, radius_m=RADIUS_M)
        path = displace(points, moving, start_s=0.0, duration_s=duration, steps=3)
        return path.sum() + map_.upwind(points).sum()

    arguments = (points, wind.eastward_m_s, wind.northward_m_s, jnp.asarray(-7200.0))
    # An entry that is not finite leaves no sum that is.
    ones = tuple(jnp.ones_like(x) for x in arguments)
    _, forward = jax.jit(lambda *x: jax.jvp(moved, x, ones))(*arguments)
    reverse = jax.jit(jax.grad(moved, argnums=(0, 1, 2, 3)))(*arguments)
    assert all(jnp.all(jnp.isfinite(g)) for g in (forward, *reverse))


def test_a_map_is_differentiable_by_its_duration():
    def eastern(hours):
        map_ = displacement_map(uniform(10.0, 0.0), hours=hours, resolution_deg=10.0)
        return map_.upwind(at(0.0, np.zeros(1)))[0, 1]

    np.testing.assert_allclose(jax.grad(eastern)(1.0), -36e3 / RADIUS_M, rtol=0.01)


def test_a_map_is_the_same_compiled_and_under_a_trace_takes_numpy_points():
    wind, points = uniform(10.0, 5.0), np.asarray(at(12.0, np.arange(0.0, 90.0, 10.0)))

    @jax.jit
    def upwind(map_: DisplacementMap):
        return map_.upwind(points)

    map_ = displacement_map(wind, hours=3.0, resolution_deg=10.0)
    np.testing.assert_allclose(upwind(map_), map_.upwind(points), atol=1e-6)
    assert map_.upwind(points[None]).shape == (1, 9, 3)


def test_upwind_is_continuous_across_the_date_line_and_the_poles():
    map_ = displacement_map(uniform(30.0, 10.0), hours=10.0, resolution_deg=10.0)
    nearby = np.asarray([[-1, 1e-9, 0.2], [-1, -1e-9, 0.2]])
    east, west = map_.upwind(nearby)
    np.testing.assert_allclose(east, west, atol=1e-7)
    ring = np.deg2rad(np.arange(0, 360, 10.0))
    pole = np.stack([1e-9 * np.cos(ring), 1e-9 * np.sin(ring), np.ones(36)], axis=1)
    assert np.ptp(map_.upwind(pole), axis=0).max() < 1e-7


def test_a_chord_through_the_earth_stays_finite():
    map_ = displacement_map(uniform(0.0, 0.0), hours=1.0, resolution_deg=10.0)
    opposite = DisplacementMap(
        -jnp.asarray(map_.grid.unit_vectors(), float),
        map_.time_s,
        map_.duration_s,
        map_.grid,
    )
    points = jnp.asarray(map_.grid.unit_vectors(), float)
    assert jnp.all(jnp.isfinite(opposite.upwind(points)))
    assert jnp.all(jnp.isfinite(jax.grad(lambda p: opposite.upwind(p).sum())(points)))


@pytest.mark.parametrize("resolution", [7.0, 120.0, 0.7])
def test_a_resolution_that_does_not_divide_the_sphere_is_refused(resolution):
    with pytest.raises(ValueError, match="divide 180"):
        displacement_map(uniform(0.0, 0.0), hours=1.0, resolution_deg=resolution)


def test_no_steps_are_refused():
    with pytest.raises(ValueError, match="at least 1"):
        displacement_map(uniform(0.0, 0.0), hours=1.0, steps=0)


def test_latitude_and_longitude_in_numpy_and_jax():
    lat, lon = np.asarray([-90.0, -10.0, 90.0]), np.asarray([0.0, -170.0, 0.0])
    found = latitude_longitude_deg(np.asarray(at(lat, lon), np.float64))
    np.testing.assert_allclose(found[0], lat, atol=1e-5)
    assert isinstance(found[0], np.ndarray)
    np.testing.assert_allclose(latitude_longitude_deg(at(lat, lon))[0], lat, atol=1e-4)
    np.testing.assert_allclose(found[1][1], lon[1], atol=1e-5)
