"""Derivatives of radiances: both modes, against differences, and on the hard set.

All through `radiances` of a view, which is what a fit differentiates.
"""

import functools as ft

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import StandardAtmosphere, radiances
from cloudjax.geometry.geodesy import ecef
from cloudjax.march.view import make_textures, sample
from tests.helpers import (
    GEOSTATIONARY_M,
    emissive_bands,
    fractal_cloud,
    geostationary_rays,
    ground_points,
    lay_along,
    layer,
    make_background,
    make_scene,
    over,
    rays_to,
    reflective_bands,
    sun,
    view_along,
)


# Every float parameter that a fit may move, at an ordinary place.
START = {
    "weight_1": 1.0,
    "weight_2": 0.5,
    "mask_gain": 1.0,
    "threshold": 0.2,
    "barrier_strength": 1.0,
    "base_m": 1000.0,
    "top_m": 3000.0,
    "barrier_scale_m": 200.0,
    "smoothing": 0.3,
    "extinction_per_m": 0.002,
    "infrared_ratio": 0.4,
    "co_albedo": 0.01,
    "indirect": 0.2,
    "path": 0.05,
    "gain": 0.9,
    "offset_k": 1.0,
}
NAMES = tuple(START)
START_VECTOR = np.array(list(START.values()))
# Tenths of the parameters' sizes: derivatives are taken per such a unit.
UNIT = 0.1 * np.abs(START_VECTOR)
FUNCTION = NAMES[2:9]
HARD_RAYS = 32


def _scene(vector, nodes=3, steps=8):
    p = dict(zip(NAMES, vector, strict=True))
    weights = jnp.stack([jnp.asarray(p["weight_1"]), jnp.asarray(p["weight_2"])])
    cloud = fractal_cloud(nodes=nodes, weights=weights, **{k: p[k] for k in FUNCTION})
    names = ("extinction_per_m", "infrared_ratio")
    changes = {k: p[k] for k in names} | {"co_albedo": p["co_albedo"] * jnp.ones(1)}
    air = {"path": p["path"], "gain": p["gain"]}
    return make_scene(
        [layer(cloud, steps=steps, **changes)],
        reflective_bands(1, **air),
        emissive_bands(13, **air),
        indirect=p["indirect"],
        temperature=StandardAtmosphere(p["offset_k"]),
    )


def _seen(scene, view):
    """Mean and mean square per band, all of about the size of one."""
    seen = radiances(scene, view)
    assert seen.reflective is not None
    assert seen.emissive is not None
    reflective, emissive = seen.reflective[0] / 100, seen.emissive[0] / 100
    values = (reflective, reflective**2, emissive, emissive**2)
    return jnp.stack([v.mean() for v in values])


def _problem(rays: int, steps: int, nodes: int):
    """The map from parameters in units to radiances, and where to look."""
    scene = _scene(START_VECTOR, nodes, steps)
    background = make_background(scene, rays)
    scene = over(scene, background)
    sight, masks = geostationary_rays(rays), [lambda φ, λ: (φ - 20) / 2]
    view = view_along(scene, sight, sun(50.0), masks, width_m=3e3)
    data = (view, background)

    def seen(x, data):
        vector = jnp.asarray(START_VECTOR, x.dtype) + jnp.asarray(UNIT, x.dtype) * x
        view, background = data
        return _seen(over(_scene(vector, nodes, steps), background), view)

    return seen, data, jnp.zeros(len(START_VECTOR))


def _differences(f, x, step):
    steps = step * jnp.eye(len(x), dtype=x.dtype)
    return np.stack([np.asarray(f(x + s) - f(x - s)) for s in steps], -1) / (2 * step)


def test_jvp_vjp_and_central_differences_agree_in_double_precision():
    with jax.enable_x64(True):
        seen, data, x = _problem(40, 8, nodes=3)
        f = jax.jit(seen)
        both = jax.jit(lambda *a: (jax.jacfwd(seen)(*a), jax.jacrev(seen)(*a)))
        forward, reverse = both(x, data)
        differences = _differences(lambda x: f(x, data), x, 1e-4)
    np.testing.assert_allclose(forward, reverse, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(forward, differences, rtol=1e-5, atol=1e-8)
    assert np.all(np.abs(forward).max(0) > 1e-6), "a parameter does nothing"


def test_jitted_jacobians_are_right_in_single_precision_at_real_size():
    """One release of jax compiled jit(jacfwd) wrongly from 500 rays on.

    2500 rays in 32 steps are as many as a fit has in a tile.
    """
    seen, data, x = _problem(2500, 32, nodes=1)
    f = jax.jit(seen)
    forward = jax.jit(jax.jacfwd(seen))(x, data)
    reverse = jax.jit(jax.jacrev(seen))(x, data)
    assert forward.dtype == jnp.float32
    scale = np.abs(reverse).max()
    np.testing.assert_allclose(forward, reverse, rtol=1e-3, atol=1e-5 * scale)
    differences = _differences(lambda x: f(x, data), x, 0.05)
    np.testing.assert_allclose(forward, differences, rtol=0.01, atol=2e-3 * scale)


def test_this_jax_does_not_miscompile_a_weighted_sum():
    """jax 0.10.2 errs by 0.6 in this function, others by 1e-6."""
    values = np.random.default_rng(0).random((2500, 32, 3), dtype=np.float32)
    textures, depth = jnp.asarray(values), (jnp.arange(32) + 0.5) * 4.0

    def f(v):
        m = jnp.array([1.0, 0, 0]) + jnp.array([0.0, 1, 0]) * v[0]
        m = m - jnp.array([0, 0, 1.0]) * v[1]
        cf = (textures * m[None, None]).sum(-1)
        cf = cf - (jnp.exp(-depth / 12.8) + jnp.exp((depth - 128) / 12.8))[None]
        d, extinction = jax.nn.sigmoid((cf - v[2]) / 0.02) * 4.0, jnp.exp(v[3])
        cumulated = jnp.cumsum(d, 1)
        after = jnp.exp(-extinction * cumulated)
        before = jnp.exp(-extinction * (cumulated - d))
        tau = 0.075 * extinction * cumulated[:, -1]
        cooling = (1 - 0.5 * jnp.exp(v[4]) * depth / 128)[None]
        warm = after[:, -1] + ((before - after) * cooling).sum(1)
        return jnp.stack([(tau / (1 + tau)).mean(), warm.mean()])

    v = jnp.array([0.5, 0.4, 0.52, -1.2, 0.1])
    forward, reverse = jax.jit(jax.jacfwd(f))(v), jax.jit(jax.jacrev(f))(v)
    np.testing.assert_allclose(forward, reverse, atol=1e-5)


# The hard set -------------------------------------------------------------------------


@ft.cache
def _compiled():
    """Radiances, gradients of their sum and forward derivatives, compiled once."""

    def total(vector, ways, textures, background):
        scene = over(_scene(vector), background)
        seen = radiances(scene, sample(scene, ways, textures))
        assert seen.reflective is not None
        assert seen.emissive is not None
        return seen.reflective.sum() + seen.emissive.sum(), seen

    def all_of_it(vector, *data):
        (_, seen), reverse = jax.value_and_grad(total, has_aux=True)(vector, *data)
        tangents = jnp.ones_like(vector)
        _, forward = jax.jvp(lambda v: total(v, *data)[0], (vector,), (tangents,))
        return seen, reverse, forward

    return eqx.filter_jit(all_of_it)


def _limb(low_m, high_m):
    """Rays from geostationary orbit that pass the Earth at altitudes."""
    angle = np.linspace(0, 2 * np.pi, HARD_RAYS)
    radius = 6.36e6 + np.linspace(low_m, high_m, HARD_RAYS)
    target = np.stack([0 * angle, radius * np.cos(angle), radius * np.sin(angle)], -1)
    return rays_to(GEOSTATIONARY_M, target)


def _around(latitude, longitude):
    above = ecef(np.array([latitude - 0.1]), np.array([longitude]), np.array([8e5]))
    return rays_to(above, ground_points(HARD_RAYS, latitude, longitude, 0.3))


VIEWS = {
    "ordinary": lambda: geostationary_rays(HARD_RAYS),
    "rays that miss": lambda: _limb(1e6, 1e7),
    "rays that graze": lambda: _limb(-4e4, 6e4),
    "north pole": lambda: _around(89.9, 0.0),
    "south pole": lambda: _around(-89.9, 77.0),
    "date line": lambda: _around(0.0, 180.0),
}
SUNS = {"noon": 0.0, "sunset": 90.0, "just set": 90.0001, "midnight": 180.0}
MASKS = {"clear": -3.7, "cloudy": 3.7, "never": -1e4, "always": 1e4}
CHANGES = {
    "no extinction": {"extinction_per_m": 0.0},
    "hardly any extinction": {"extinction_per_m": 1e-30},
    "huge extinction": {"extinction_per_m": 1e4},
    "white": {"co_albedo": 0.0},
    "black": {"co_albedo": 1.0},
    "white and huge": {"co_albedo": 0.0, "extinction_per_m": 1e4},
    "black and huge": {"co_albedo": 1.0, "extinction_per_m": 1e4},
    "no weights, no smoothing": {"weight_1": 0.0, "weight_2": 0.0, "smoothing": 0.0},
    "hard": {"smoothing": 0.0},
    "steep barriers": {"barrier_scale_m": 1.0},
    "base above top": {"base_m": 9e3, "top_m": -9e3},
    "no infrared": {"infrared_ratio": 0.0},
    "opaque air": {"gain": 0.0},
    "absolute zero": {"offset_k": -400.0},
    "far too warm": {"offset_k": 1e4},
    "threshold out of reach": {"threshold": 1e6},
    "threshold far below": {"threshold": -1e6},
}


def _check(view="ordinary", zenith=30.0, mask=0.0, width_m=0.0, **changes):
    vector = jnp.asarray(list((START | changes).values()))
    background = make_background(_scene(START_VECTOR), HARD_RAYS)
    scene = over(_scene(START_VECTOR), background)
    ways = lay_along(
        scene, VIEWS[view](), sun(zenith), [lambda φ, λ: 0 * φ + mask], width_m=width_m
    )
    seen, reverse, forward = _compiled()(vector, ways, make_textures(scene), background)
    for leaf in jax.tree.leaves((seen, reverse, forward)):
        assert jnp.isfinite(leaf).all()
    assert seen.reflective.min() > -1e-3
    assert seen.emissive.min() > -1e-3


@pytest.mark.parametrize("zenith", SUNS.values(), ids=SUNS)
@pytest.mark.parametrize("view", VIEWS)
def test_derivatives_are_finite_from_everywhere(view, zenith):
    _check(view, zenith)


@pytest.mark.parametrize("mask", MASKS.values(), ids=MASKS)
def test_derivatives_are_finite_all_clear_and_all_cloudy(mask):
    _check(mask=mask)
    _check("rays that graze", mask=mask, width_m=5e3)


@pytest.mark.parametrize("changes", CHANGES.values(), ids=CHANGES)
@pytest.mark.parametrize("width_m", [0.0, 5e3])
def test_derivatives_are_finite_at_the_ends_of_the_parameters(changes, width_m):
    _check("rays that graze", width_m=width_m, **changes)
