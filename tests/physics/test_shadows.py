"""Shadows and sunny sides, against Monte Carlo, tilted slabs and plain geometry."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array, Float

from cloudjax import (
    GriddedCloud,
    HenyeyGreenstein,
    PlaneParallel,
    Rays,
    Scene,
    Shadows,
    Shell,
    Slabs,
)
from cloudjax.geometry.geodesy import ecef
from tests.helpers import (
    fractal_cloud,
    layer,
    make_background,
    make_scene,
    reflective_bands,
    seen_along,
    sun,
)


ASYMMETRY = 0.85
SLABS = PlaneParallel.load()


def _lit(clouds, shadows: Shadows | None, albedo=1.0, **changes) -> Scene:
    """Layers for one band, in the paper's light, which compiles in no time."""
    particles = {"co_albedo": [1 - albedo], "asymmetry": [ASYMMETRY]}
    layers = [layer(cloud, emissive=0, **particles, **changes) for cloud in clouds]
    return replace(make_scene(layers, reflective_bands(1)), shadows=shadows)


def _down(east_m: Float[np.ndarray, " rays"], zenith_deg: float = 0.0) -> Rays:
    """Parallel rays to points of the equator east of longitude 0, from the north."""
    longitude = np.degrees(east_m / 6378137.0)
    target = ecef(0 * longitude, longitude, 0 * longitude)
    θ = np.radians(zenith_deg)
    direction = np.broadcast_to([-np.cos(θ), 0.0, -np.sin(θ)], target.shape)
    return Rays(target - 1e5 * direction, direction, 1e-4)


def _east(zenith_deg: float) -> Float[np.ndarray, "3"]:
    """Towards a sun in the east of 0 N 0 E; in the west for a negative angle."""
    θ = np.radians(zenith_deg)
    return np.array([np.cos(θ), np.sin(θ), 0.0])


def _seen(scene: Scene, rays: Rays, sun_direction, behind=0.0) -> np.ndarray:
    """Reflectance factors πL/E."""
    background = make_background(scene, len(rays), reflected=behind)
    seen = seen_along(scene, rays, sun_direction, background).reflective
    assert seen is not None
    assert scene.reflective is not None
    return np.asarray(scene.reflective.reflectance(seen)[0], float)


def _change(clouds, rays: Rays, sun_direction, sunward: int, **options) -> np.ndarray:
    """What shadows of so many steps multiply the light by."""
    behind = options.pop("behind", 0.0)
    without, with_them = (
        _seen(_lit(clouds, shadows, **options), rays, sun_direction, behind)
        for shadows in (None, Shadows(sunward))
    )
    return with_them / without


def _columns(density: Float[Array, "x z"], shell: Shell, wide_m: float, **grid):
    return GriddedCloud(
        density=density[:, None],
        shell=shell,
        corner_deg=(-0.5, 0.0),
        spacing_m=(wide_m, 110574.0),
        **grid,
    )


# The step cloud: 16 columns of optical depth 2, 16 of 18, each 500/32 m wide.
STEP = _columns(
    jnp.where(jnp.arange(32) < 16, 2 / 18, 1.0)[:, None] * jnp.ones((1, 16)),
    Shell(1000.0, 1250.0),
    500 / 32,
    periodic=True,
)


def _step_cloud(zenith_deg, albedo, shadows: Shadows | None) -> np.ndarray:
    """Nadir reflectance πL/(μ₀E) of the middles of the columns, sun in the west."""
    scene = _lit([STEP], shadows, albedo, extinction_per_m=18 / 250, steps=24)
    scene = replace(scene, reflection=Slabs(SLABS))
    rays = _down((np.arange(32) + 0.5) * 500 / 32)
    return _seen(scene, rays, _east(-zenith_deg)) / np.cos(np.radians(zenith_deg))


@pytest.mark.parametrize(("zenith_deg", "albedo"), [(0, 1.0), (60, 1.0), (60, 0.99)])
def test_without_shadows_pixels_are_independent(zenith_deg, albedo):
    """The I3RC step cloud, seen straight down, sun at 0 and 60 degrees.

    Expectation: the reflectance of slabs of optical depth 2 and 18, but for columns
    next to a step, whose grid is linear in between. Source: `PlaneParallel`. Tolerance:
    2e-3, the curvature of the Earth within half a kilometre and float32.
    """
    found = _step_cloud(zenith_deg, albedo, None)
    ones = jnp.ones(2)
    μ = np.cos(np.radians(zenith_deg))
    expected = SLABS.reflectance(
        jnp.asarray([2.0, 18.0]),
        jnp.asarray(1 - albedo),
        HenyeyGreenstein(jnp.asarray(ASYMMETRY)),
        μ * ones,
        ones,
        -μ * ones,
    )
    for half, value in zip((found[1:15], found[17:31]), expected, strict=True):
        np.testing.assert_allclose(half, value, rtol=2e-3)


@pytest.mark.shared_data
@pytest.mark.parametrize(
    ("experiment", "zenith_deg", "albedo", "independent", "shaded"),
    [
        (1, 0, 1.0, (0.269, 0.139), (0.269, 0.139)),
        (2, 60, 1.0, (-0.131, 0.106), (-0.010, 0.076)),
        (4, 60, 0.99, (-0.149, 0.101), (-0.038, 0.054)),
    ],
)
def test_the_step_cloud_of_i3rc(
    shared_data: Path, experiment, zenith_deg, albedo, independent, shaded
):
    """Nadir reflectance of 32 columns, against the Monte Carlo codes' consensus.

    Geometry: columns of optical depth 2 and 18, 250 m wide and thick each, periodic,
    Henyey-Greenstein with g = 0.85, black ground; sun overhead, and at 60 degrees over
    the thin side, without absorption and with ω = 0.99. Expectation: relative error of
    the mean and root-mean-square error of the columns, of independent pixels and with
    shadows of 6 steps from 5 points of each ray. Source: I3RC phase 1, case 1 (Cahalan
    et al. 2005, BAMS 86, 1275), consensus results. Tolerance: 0.003, how far other
    numbers of steps are.

    With the sun overhead there is no shadow: what is wrong there is light that leaves
    thick columns sideways, which no ray to the sun can know of.
    """
    name = f"I3RC_cons_res_case1_exp{experiment}_Iu.txt"
    truth = np.loadtxt(shared_data / "i3rc_case1" / "consensus_results" / name)
    for shadows, expected in ((None, independent), (Shadows(6), shaded)):
        found = _step_cloud(zenith_deg, albedo, shadows)
        mean = found.mean() / truth.mean() - 1
        rms = np.sqrt(np.mean((found - truth) ** 2))
        np.testing.assert_allclose((mean, rms), expected, atol=3e-3)


@pytest.mark.parametrize("seen", ["deck", "ground"])
def test_a_wall_casts_a_shadow_of_the_right_length(seen):
    """A wall 400 m wide and up to 3 km high, sun at 60 degrees behind it in the west.

    Expectation: a shadow from its foot to (3 km - z) tan 60° behind it, on the ground
    at z = 0 and on a deck of cloud from 1.0 to 1.2 km, where half of the deck's light
    turns above 1.1 km; darkest where the sun's ray crosses all of the wall, by two
    streams of its depth, 400 m/tan 60° times the extinction; no change in front of the
    wall and beyond the shadow. Tolerance: 250 m for its end, a step of the march and a
    cell; 3 % for its depth; 1e-4 where nothing changes, for altitudes keep centimetres
    of the deck's 200 m, and both ways lose the same ones or not as they are compiled.
    """
    x = jnp.arange(160)[:, None] * jnp.ones((1, 8))
    wall = _columns(1.0 * ((x >= 60) & (x < 64)), Shell(1200.0, 3000.0), 100.0)
    deck = _columns(jnp.ones((160, 8)), Shell(1000.0, 1200.0), 100.0)
    on_deck = seen == "deck"
    clouds, drop_m = ([wall, deck], 1900.0) if on_deck else ([wall], 3000.0)
    east = np.linspace(4000.0, 15000.0, 111)
    behind = 0.0 if on_deck else 50.0
    light = {"extinction_per_m": 0.05, "behind": behind}
    found = _change(clouds, _down(east), _east(-60.0), 24, **light)
    end = 6400 + drop_m * np.sqrt(3)
    assert abs(east[(found < 0.99) & (east > 6500)].max() - end) < 250
    lit = (east < 5900) | (east > end + 250)
    np.testing.assert_allclose(found[lit], 1, atol=1e-4)
    b = (1 - ASYMMETRY) / 2
    expected = 1 / (1 + b * 0.05 * 400 / np.sqrt(3))
    middle = (east > end - 2500) & (east < end - 800)
    np.testing.assert_allclose(found[middle].mean(), expected, rtol=0.03)


@pytest.mark.parametrize("slope_deg", [-15.0, -5.0, 5.0, 15.0])
def test_slopes_are_lit_as_tilted_slabs(slope_deg):
    """A thick wedge of cloud, seen straight down, sun at 60 degrees.

    Expectation: brighter than a level cloud where its top rises away from the sun,
    darker where it falls, by 0.55 to 1 times as much as an endless slab of that tilt
    is: a cautious part of it, for slopes do end. Source: `PlaneParallel` with the
    cosines to the slope's normal.
    """
    x, z = np.meshgrid((np.arange(80) + 0.5) * 100, (np.arange(80) + 0.5) * 40)
    rise = np.tan(np.radians(slope_deg))
    top = 1800 + (x - 4000) * rise
    density = jnp.asarray(np.clip((top - z) / 40 + 0.5, 0, 1).T, jnp.float32)
    wedge = _columns(density, Shell(0.0, 3200.0), 100.0)
    east = np.linspace(3500, 4500, 11)
    sunward = _east(-60.0)
    found = _change([wedge], _down(east), sunward, 24, extinction_per_m=0.08, steps=48)
    tilt = np.radians([0.0, slope_deg])
    μ0, μ = np.cos(np.pi / 3 - tilt), np.cos(tilt)
    slab = jnp.full(2, 120.0), jnp.asarray(0.0), HenyeyGreenstein(jnp.asarray(0.85))
    cosines = (jnp.asarray(c, float) for c in (μ0, μ, np.full(2, -0.5)))
    level, tilted = μ0 * np.asarray(SLABS.reflectance(*slab, *cosines))
    share = (found.mean() - 1) / (tilted / level - 1)
    assert 0.55 < share < 1


@pytest.mark.parametrize("zenith_deg", [0.0, 60.0, 85.0])
def test_level_clouds_do_not_shade_themselves(zenith_deg):
    """Two level layers with soft edges, one above the other, seen at 40 degrees.

    Expectation: the same light as without shadows, for what stands between the sun and
    each altitude is what stands between it and the viewer. Tolerance: 1e-3.
    """
    level: dict[str, Any] = {"weights": (0.0, 0.0), "mask_gain": 0.0, "threshold": -0.5}
    low = fractal_cloud(nodes=3, **level)
    edges: dict[str, Any] = {"base_m": 6e3, "top_m": 7e3}
    high = fractal_cloud(Shell(4500.0, 9000.0), nodes=3, **level, **edges)
    rays = _down(np.linspace(0, 1e4, 8), 40.0)
    options = {"extinction_per_m": 0.004, "behind": 50.0, "steps": 24}
    found = _change([low, high], rays, _east(zenith_deg), 6, **options)
    np.testing.assert_allclose(found, 1, atol=1e-3)


@pytest.mark.parametrize("zenith_deg", [0.0, 40.0])
def test_shadows_hide_behind_what_casts_them(zenith_deg):
    """Broken cloud, the sun behind the viewer: overhead for one who looks down.

    Expectation: no change, for each shadow is behind its cloud. Tolerance: 1 % at
    extinctions of 0.01 per metre, of which a step of the march, 73 m, is most of an
    optical depth.
    """
    rays = _down(np.linspace(0, 6e4, 64), zenith_deg)
    cloud = fractal_cloud(nodes=3)
    options = {"extinction_per_m": 0.01, "behind": 20.0, "steps": 48}
    found = _change([cloud], rays, -rays.direction[0], 6, **options)
    np.testing.assert_allclose(found, 1, atol=0.01)
    aslant = _change([cloud], rays, sun(60.0, 0.0, 0.0), 6, **options)
    assert np.ptp(aslant) > 0.3
