"""Air: derivatives, the hard set, and what it costs."""

import functools as ft

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import ProfileGrid, Shell, StandardAtmosphere, radiances
from cloudjax.air.clear_air import Air, Column, Emission
from cloudjax.air.gases import LEVELS_M, Columns
from cloudjax.geometry.geodesy import ecef
from cloudjax.geometry.latlon_grid import LatLonGrid
from tests.helpers import (
    GEOSTATIONARY_M,
    emissive_bands,
    fractal_cloud,
    geostationary_rays,
    lay_along,
    layer,
    limb_rays,
    make_background,
    make_scene,
    numbers,
    over,
    rays_to,
    reflective_bands,
    sun,
    view_along,
)


RAYS = 8
EVERYWHERE = Shell(-500.0, 100e3)


def scene_of(air, offset_k=0.0, extinction=0.002, reflective=(1, 3), emissive=(8, 13)):
    return make_scene(
        [
            layer(
                fractal_cloud(),
                reflective=len(reflective),
                emissive=len(emissive),
                extinction_per_m=extinction,
                steps=6,
            )
        ],
        reflective_bands(*reflective) if reflective else None,
        emissive_bands(*emissive) if emissive else None,
        temperature=StandardAtmosphere(offset_k),
        air=air,
    )


def _view(scene):
    return view_along(scene, geostationary_rays(RAYS), sun(40))


def _operations(jaxpr) -> int:
    """Of a program and all that it calls."""
    inner = [
        sub
        for equation in jaxpr.eqns
        for value in equation.params.values()
        for sub in jax.tree.leaves(value, is_leaf=lambda x: hasattr(x, "eqns"))
        if hasattr(sub, "eqns") or hasattr(sub, "jaxpr")
    ]
    return len(jaxpr.eqns) + sum(_operations(getattr(s, "jaxpr", s)) for s in inner)


def _cost(scene) -> int:
    scene = over(scene, make_background(scene, RAYS))
    program = eqx.filter_make_jaxpr(radiances)(scene, _view(scene))[0]
    return _operations(program.jaxpr)


def test_what_is_left_out_is_not_compiled():
    """Band 6 scatters too little: its air has gases only, and no exponential more."""

    def cost(band: int, air: Air | None) -> int:
        return _cost(scene_of(air, reflective=(band,), emissive=()))

    without = cost(6, None)
    gases = cost(6, Air.of_bands((6,)))
    molecules = cost(1, Air.of_bands((1,)))
    both = cost(3, Air.of_bands((3,)))
    assert Air.of_bands((6,)).scattered == ()
    assert without < gases < both
    # Band 1 has no gases to speak of.
    assert Air.of_bands((1,)).absorbed == ()
    assert without < molecules < both


def test_a_scene_without_air_is_navigated_without():
    ways = lay_along(scene_of(None), geostationary_rays(RAYS), sun(40))
    assert ways.around.column is None


def test_both_modes_and_differences_agree():
    air = Air.of_bands((3, 8))
    some = ft.partial(scene_of, air, reflective=(3,), emissive=(8,))
    background = make_background(some(), RAYS)
    view = _view(over(some(), background))

    def seen(x):
        scene = over(some(offset_k=x[0], extinction=x[1] * 0.002), background)
        found = radiances(scene, view)
        assert found.reflective is not None
        assert found.emissive is not None
        means = [found.reflective.mean(1) / 100, found.emissive.mean(1) / 10]
        return jnp.concatenate(means)

    x = numbers(1.0, 1.0)
    forward, backward = jax.jit(jax.jacfwd(seen))(x), jax.jit(jax.jacrev(seen))(x)
    np.testing.assert_allclose(forward, backward, rtol=1e-3, atol=1e-4)
    run = jax.jit(seen)
    for i, step in enumerate((2.0, 0.05)):
        e = step * jnp.eye(2)[i]
        slope = (run(x + e) - run(x - e)) / (2 * step)
        np.testing.assert_allclose(forward[:, i], slope, rtol=0.02, atol=2e-3)


def _column(view: float, sun: float, **amounts) -> Column:
    shape = (1, len(LEVELS_M))
    pressure = jnp.exp(-jnp.asarray(LEVELS_M, float) / 8000.0)[None]
    fields = {
        "pressure": pressure,
        "water": 4 * pressure**4,
        "continuum": 0.05 * pressure**8,
        "ozone": 0.3 * jnp.ones(shape),
        "ozone_pressure": 0.05 * pressure,
    } | {name: jnp.full(shape, value, float) for name, value in amounts.items()}
    return Column(
        Columns(**fields), None, numbers(view), numbers(sun), numbers(1.0), numbers(-1)
    )


HARD = {
    "ordinary": _column(0.7, 0.7),
    "nothing at all": _column(1.0, 1.0, **dict.fromkeys(Columns.__annotations__, 0.0)),
    "horizon": _column(0.025, 0.025),
    "a steam bath": _column(0.025, 1.0, water=50.0, continuum=5.0),
}


def test_values_and_gradients_are_finite_on_the_hard_set():
    air = Air.of_bands((1, 3, 8, 12, 13))
    sunlit, thermal = reflective_bands(1, 3), emissive_bands(8, 12, 13)

    def seen(column, altitude_m, offset_k):
        temperature = StandardAtmosphere(offset_k)
        veil = air.veil(sunlit, column, temperature, altitude_m)
        cloud = jnp.full_like(veil.path, 0.6)
        emission = air.emission(thermal, column, temperature)
        black = emission.black_bodies(altitude_m[:, None], EVERYWHERE)[..., 0]
        ground = emission.over(black, altitude_m) + emission.above(altitude_m)
        return (veil.path + veil.over(cloud, column.sun)).sum() + ground.sum()

    run = jax.jit(jax.value_and_grad(seen, argnums=(0, 1, 2)))
    for column in HARD.values():
        # Below the ground, on a level, above the table.
        for altitude_m in (-400.0, 2000.0, 80e3):
            value, slopes = run(column, numbers(altitude_m), jnp.asarray(-30.0))
            assert np.isfinite(value)
            assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(slopes))


@pytest.mark.parametrize(
    "shell", [Shell(500.0, 4000.0), Shell(4100.0, 4300.0), Shell(0.0, 60e3), EVERYWHERE]
)
def test_black_bodies_in_a_shell_are_read_between_the_levels_around_it(shell):
    """Their logarithm is linear there; beyond the table the last level holds."""
    levels = np.linspace(5.0, -3.0, len(LEVELS_M))
    nothing, black = jnp.zeros((1, 1, len(LEVELS_M))), jnp.exp(numbers(*levels))
    emission = Emission(black[None, None], nothing + 1, nothing)
    altitude_m = np.linspace(shell.bottom_m, shell.top_m, 41)
    found = emission.black_bodies(numbers(*altitude_m)[None], shell)[0, 0]
    np.testing.assert_allclose(
        np.log(found), np.interp(altitude_m, LEVELS_M, levels), atol=2e-5
    )


def _column_along(air: Air, rays, sun_direction) -> Column:
    return air.look(rays, rays.ground()[0], sun_direction)


def test_rays_that_miss_the_earth_have_air_too():
    column = _column_along(Air.of_bands((3, 13)), limb_rays(-2e3, 5e3, 4e4), sun(40))
    for leaf in jax.tree.leaves(column):
        assert np.isfinite(leaf).all()
    assert float(column.view.min()) == pytest.approx(1 / 40, rel=0.05)


def test_twilight_fades():
    """The sun at the horizon and 2, 6 and 12 degrees below it: air's light goes out."""
    bands, air = reflective_bands(1), Air.of_bands((1,))
    seen = []
    for zenith in (90, 92, 96, 102):
        column = _column_along(air, geostationary_rays(1, 0.01), sun(zenith))
        veil = air.veil(bands, column, StandardAtmosphere(), numbers(0.0))
        seen.append(float(veil.path[0, 0]))
    assert np.all(np.diff(seen) < 0)
    assert 1e-3 < seen[0] < 0.03
    assert seen[-1] < 1e-6


def test_air_that_differs_from_place_to_place_is_that_of_the_ray():
    """Nodes 1 degree apart, each as moist as its row; rays to the middles of rows."""
    latitude, longitude = np.arange(19.0, 23.0), np.arange(8.0, 12.0)
    humidity = 0.001 * np.arange(4.0)[:, None] * np.exp(-LEVELS_M / 2000)
    humidity = np.broadcast_to(humidity[:, None], (4, 4, len(LEVELS_M)))
    profiles = ProfileGrid(
        jnp.full(humidity.shape, 250.0),
        jnp.asarray(humidity, float),
        LatLonGrid.from_axes(latitude, longitude),
    )
    air = Air.of_bands((8,), profiles=profiles)
    place = ecef(np.array([19.0, 20.0, 21.0]), np.full(3, 10.0), np.zeros(3))
    column = _column_along(air, rays_to(GEOSTATIONARY_M, place), sun(40))
    assert column.above is not None
    water = np.asarray(column.above.water[:, 0])
    assert water[0] == pytest.approx(0, abs=1e-6 * float(water[1]))
    assert water[2] == pytest.approx(2 * water[1], rel=1e-3)
    assert column.temperature_k is not None
