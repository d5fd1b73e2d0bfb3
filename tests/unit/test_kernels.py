"""Clouds of Gaussian kernels, against what many particles on a grid are."""

import dataclasses
import functools as ft

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad_vec

from cloudjax import Rays, look, radiances
from cloudjax.clouds.columns import ColumnCloud
from cloudjax.clouds.kernels import KernelCloud
from cloudjax.geometry.column_grid import ColumnGrid
from cloudjax.geometry.geodesy import ecef, up
from cloudjax.geometry.map_projections import LocalPlane
from cloudjax.geometry.shells import chords
from cloudjax.light.bulk_extinction import extinction_m2_g
from cloudjax.light.optics import Particles
from cloudjax.march.column_layer import kernel_layer
from cloudjax.particles.cloud_particles import CloudParticles
from cloudjax.particles.deposit import deposited
from cloudjax.particles.placement import DepthColumns
from tests.helpers import make_scene, reflective_bands, sampling, sun


STEPS, COUNT = 32, 40
RNG = np.random.default_rng(5)
LATITUDE, LONGITUDE = 45 + RNG.uniform(-0.05, 0.05, (2, COUNT)) * [[1], [1.4]]
ALTITUDE = RNG.uniform(2500, 4500, COUNT)
AREA = RNG.uniform(1e6, 8e6, COUNT)
RADIUS = RNG.uniform(800, 1800, COUNT)
NOTHING = np.zeros(COUNT)
PARTICLES = CloudParticles(
    LATITUDE,
    LONGITUDE,
    ALTITUDE,
    RADIUS,
    AREA,
    np.zeros((COUNT, 3)),
    NOTHING,
    NOTHING,
    np.linspace(0, 1, COUNT),
)
CLOUD = KernelCloud.of(PARTICLES.position_m(), AREA, PARTICLES.deviation_m)


def _rays(latitude, longitude, altitude, zenith_deg) -> Rays:
    """From far above through places, from the south-east."""
    latitude, longitude, altitude = (
        np.atleast_1d(x).astype(float) for x in (latitude, longitude, altitude)
    )
    place, vertical = ecef(latitude, longitude, altitude), up(latitude, longitude)
    level = np.cross(vertical, [0.3, -0.8, 0.5])
    level /= np.linalg.norm(level, axis=-1, keepdims=True)
    θ = np.radians(zenith_deg)
    back = np.cos(θ) * vertical + np.sin(θ) * level
    return Rays(place + 1e6 * back, -back, 1e-5)


@ft.partial(jax.jit, static_argnames="steps")
def _fraction(cloud, way, steps):
    samples = cloud.sample(way, (), steps=steps, slopes=False)
    return cloud.occupancy(samples, steps).fraction[0]


def _depth(cloud, rays: Rays, steps=STEPS) -> np.ndarray:
    way = cloud.navigate(rays, chords(rays, cloud.shell), sampling())
    step = np.asarray(way.path.length_m) / steps
    found = np.asarray(_fraction(cloud, way, steps), float).sum(-1)
    return cloud.extinction_per_m * found * step


def test_through_the_middle_of_one_the_depth_is_its_area_over_that_of_its_disc():
    """A/(2πσ²) straight through, and exp(-b²/2σ²) of it beside, within 0.1 %."""
    place = PARTICLES.position_m()[:1]
    one = KernelCloud.of(place, AREA[:1], np.array([600.0]))
    most = AREA[0] / (2 * np.pi * 600.0**2)
    for beside in (0.0, 600.0, 1500.0):
        rays = _rays(LATITUDE[0], LONGITUDE[0], ALTITUDE[0], 40.0)
        across = np.cross(rays.direction, [0.0, 0.0, 1.0])
        across /= np.linalg.norm(across)
        moved = dataclasses.replace(rays, origin_m=rays.origin_m + beside * across)
        found = _depth(one, moved)
        np.testing.assert_allclose(
            found, most * np.exp(-0.5 * (beside / 600.0) ** 2), rtol=1e-3
        )


@pytest.mark.parametrize("zenith_deg", [0.0, 75.0])
def test_a_ray_has_the_depth_of_a_dense_sum_of_extinction(zenith_deg):
    """Of all kernels, along a thousand kilometres, within 0.1 % of the largest."""
    rays = _rays(LATITUDE, LONGITUDE, ALTITUDE, zenith_deg)
    place, σ = PARTICLES.position_m(), PARTICLES.deviation_m

    def extinction(s):
        at = rays.origin_m + (1e6 + s) * rays.direction
        off = ((at[:, None] - place[None]) ** 2).sum(-1)
        dense = AREA / ((2 * np.pi) ** 1.5 * σ**3)
        return (dense * np.exp(-off / (2 * σ**2))).sum(-1)

    expected, _ = quad_vec(extinction, -4e4, 4e4, epsrel=1e-6, points=[0.0])
    found = _depth(CLOUD, rays)
    np.testing.assert_allclose(found, expected, atol=1e-3 * expected.max())
    assert expected.max() > 2


def test_steps_share_out_what_a_ray_has():
    rays = _rays(LATITUDE, LONGITUDE, ALTITUDE, 30.0)
    np.testing.assert_allclose(_depth(CLOUD, rays, 4), _depth(CLOUD, rays), rtol=1e-4)


def test_a_way_that_leaves_a_ray_meets_what_a_ray_from_there_meets():
    """Towards the zenith, from the middles of the kernels: half of each, and others."""
    rays = _rays(LATITUDE, LONGITUDE, ALTITUDE, 50.0)
    chord = chords(rays, CLOUD.shell)
    way = CLOUD.navigate(rays, chord, sampling())
    vertical = up(LATITUDE, LONGITUDE)
    ends = jnp.asarray(np.linspace(0, 8e3, STEPS + 1) + np.zeros((COUNT, 1)))
    left = CLOUD.branch(
        way,
        (),
        jnp.asarray(1e6 - chord.entry_m, float),
        jnp.asarray(vertical, float),
        ends,
    )
    found = np.asarray(_fraction(CLOUD, left, STEPS), float).sum(-1) * 8e3 / STEPS
    from_above = _rays(LATITUDE, LONGITUDE, ALTITUDE, 0.0)
    whole = CLOUD.navigate(from_above, chords(from_above, CLOUD.shell), sampling())
    last = _above(from_above, STEPS)
    place = dataclasses.replace(
        whole, path=dataclasses.replace(whole.path, ends_m=last)
    )
    expected = np.asarray(_fraction(CLOUD, place, STEPS), float)
    expected = (expected * np.diff(last)).sum(-1)
    np.testing.assert_allclose(found, expected, rtol=2e-3)


def _above(rays: Rays, steps: int):
    """Ends of steps on the last 8 km before the places that the rays are sent to."""
    entry = chords(rays, CLOUD.shell).entry_m
    return jnp.asarray(1e6 - entry[:, None] + np.linspace(-8e3, 0, steps + 1), float)


def _columns(spacing=400.0, depth=150.0, levels=40) -> DepthColumns:
    count = 75
    first = -spacing * (count - 1) / 2
    grid = ColumnGrid(
        LocalPlane(45.0, 45.0), (first, first), (spacing, spacing), (count, count)
    )
    ends = 500 + depth * np.arange(levels + 1.0)
    heights = ends[:, None, None] + np.zeros((count, count))
    return DepthColumns(grid, heights, np.zeros((levels, count, count)))


def test_what_is_deposited_is_all_that_particles_have():
    """To 1e-6 in all, and of ice; of wide particles and of points, at edges too."""
    columns = _columns()
    for radius in (1.0, 500.0, 9e3):
        some = dataclasses.replace(PARTICLES, radius_m=NOTHING + radius)
        found = deposited(some, columns)
        np.testing.assert_allclose(found.extinction_area_m2(), AREA.sum(), rtol=1e-6)
        frozen = (found.depth * found.ice_share).sum(0) * columns.grid.area_m2()
        np.testing.assert_allclose(
            frozen.sum(), (AREA * PARTICLES.ice_share).sum(), rtol=1e-6
        )


def test_a_point_is_in_its_own_cell():
    columns = _columns()
    one = dataclasses.replace(PARTICLES, radius_m=NOTHING + 1.0)[[3]]
    found = deposited(one, columns).depth
    row, column = columns.grid.index(one.latitude_deg, one.longitude_deg)
    level = (columns.heights_m[1:, 0, 0] < one.altitude_m).sum()
    cell = level, round(row.item()), round(column.item())
    assert found[cell] == found.max()
    np.testing.assert_allclose(found[cell], found.sum(), rtol=1e-9)


def test_particles_beyond_the_columns_are_left_out():
    far = dataclasses.replace(PARTICLES, latitude_deg=PARTICLES.latitude_deg + 3)
    assert deposited(far, _columns()).depth.max() == 0


def test_deposited_and_exact_kernels_look_alike():
    """Straight down, through the middles, where they differ most, away from the edges.

    A cell averages over its own width d, and columns are linear in between: variances
    grow from σ² to σ² + d²/4, and depth at the middle falls by 1 to 5 % with d = 160 m.
    """
    held = deposited(PARTICLES, columns := _columns(160.0))
    height = np.diff(columns.heights_m, axis=0)
    per_gram = float(extinction_m2_g("water", jnp.asarray(10.0)))
    content = held.depth / height / per_gram
    many = ColumnCloud.of(
        columns.grid, columns.heights_m, "water", content, 0 * content + 10
    )
    inside = (abs(LATITUDE - 45) < 0.03) & (abs(LONGITUDE - 45) < 0.04)
    rays = _rays(LATITUDE, LONGITUDE, ALTITUDE, 0.0)[inside]
    found, exact = _depth(many, rays), _depth(CLOUD, rays)
    blurred = np.sqrt(PARTICLES.deviation_m**2 + 160.0**2 / 4)
    expected = _depth(KernelCloud.of(PARTICLES.position_m(), AREA, blurred), rays)
    assert np.sqrt(((found - exact) ** 2).mean()) < 0.05 * exact.mean()
    assert np.sqrt(((found - expected) ** 2).mean()) < 0.01 * exact.mean()


def test_a_layer_of_kernels_is_seen_and_moves():
    """The sea is dark beside a kernel; a step to the north brightens its north."""
    bands = reflective_bands(2)
    place = PARTICLES.position_m()[:1]
    one = KernelCloud.of(place, np.array([4e7]), np.array([1000.0]))
    water = Particles("water", jnp.asarray(10.0))
    layer = kernel_layer(one, water, sunlit=[2], steps=STEPS)
    scene = make_scene([layer], bands)
    rays = _rays(
        LATITUDE[0] + np.array([0, 0.02, 0.2]),
        LONGITUDE[0] + np.zeros(3),
        np.zeros(3),
        0.0,
    )
    view = look(scene, rays, sun(40.0))

    def seen(north_m):
        moved = one.place_m + jnp.asarray([[0.0, 1.0, 0.0]]) * north_m
        cloud = dataclasses.replace(one, place_m=moved)
        own = dataclasses.replace(layer, cloud=cloud)
        return radiances(dataclasses.replace(scene, layers=(own,)), view).reflective[0]

    found, slope = jax.jvp(seen, (jnp.asarray(0.0),), (jnp.asarray(1.0),))
    middle, north, beside = np.asarray(found)
    assert middle > north > 1.5 * beside
    assert slope[1] > 1e-2
    assert slope[2] == 0
