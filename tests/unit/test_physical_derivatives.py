"""Derivatives with physical light in whole scenes, on the hard set.

Both modes in float32, at the size of a fit's tile, against differences in float64.
"""

import dataclasses
import functools as ft

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import EmittingSlabs, PlaneParallel, Slabs, radiances
from tests.helpers import (
    emissive_bands,
    fractal_cloud,
    geostationary_rays,
    layer,
    make_background,
    make_scene,
    over,
    reflective_bands,
    sun,
    view_along,
)


START = {
    "threshold": 0.2,
    "top_m": 3000.0,
    "extinction_per_m": 0.01,
    "infrared_ratio": 0.4,
    "co_albedo": 0.01,
    "asymmetry": 0.85,
    "thermal_co_albedo": 0.4,
    "thermal_asymmetry": 0.9,
}
NAMES = tuple(START)
# Of differences. A white, deep cloud notices an absorption of 1e-9.
STEP = np.array([1e-5, 0.1, 1e-7, 1e-5, 1e-11, 1e-6, 1e-7, 1e-6])
RAYS, STEPS = 1500, 24


def _scene(vector):
    p = dict(zip(NAMES, vector, strict=True))
    cloud = fractal_cloud(threshold=p["threshold"], top_m=p["top_m"])
    one = jnp.ones(1)
    own = layer(
        cloud,
        steps=STEPS,
        relative_absorption=one,
        **{k: p[k] for k in ("extinction_per_m", "infrared_ratio")},
        **{k: p[k] * one for k in NAMES[4:]},
    )
    scene = make_scene([own], reflective_bands(1), emissive_bands(13))
    networks = PlaneParallel.load()
    return dataclasses.replace(
        scene, reflection=Slabs(networks), emission=EmittingSlabs(networks)
    )


def _seen(vector, view, background):
    """Mean and mean square of each band, all of about the size of one."""
    seen = radiances(over(_scene(vector), background), view)
    assert seen.reflective is not None
    assert seen.emissive is not None
    values = seen.reflective[0] / 100, seen.emissive[0] / 100
    return jnp.stack([m for v in values for m in (v.mean(), (v**2).mean())])


@ft.cache
def _compiled():
    both = jax.jit(lambda *a: (jax.jacfwd(_seen)(*a), jax.jacrev(_seen)(*a)))
    return both, jax.jit(_seen)


def _data(zenith: float, mask: float):
    scene = _scene(START.values())
    background = make_background(scene, RAYS)
    masks = [lambda φ, λ: (φ - 20) / 2 + mask]
    rays, scene = geostationary_rays(RAYS), over(scene, background)
    view = view_along(scene, rays, sun(zenith), masks, width_m=3e3)
    return view, background


def _differences(f, x):
    """Central, or of second order from the end of a range inwards."""
    columns = []
    for i, step in enumerate(STEP):
        e = np.zeros_like(x)
        e[i] = step
        if x[i] < step or (x[i] > 1 - step and NAMES[i] in NAMES[4:]):
            e = e if x[i] < step else -e
            column = (4 * f(x + e) - f(x + 2 * e) - 3 * f(x)) / (2 * e[i])
        else:
            column = (f(x + e) - f(x - e)) / (2 * step)
        columns.append(column)
    return np.stack(columns, axis=-1)


CASES = {
    "ordinary": {},
    "white": {"co_albedo": 0.0},
    "black": {"co_albedo": 1.0},
    "white to heat": {"thermal_co_albedo": 0.0},
    "black to heat": {"thermal_co_albedo": 1.0},
    "no cloud": {"extinction_per_m": 0.0},
    "an optical depth of 1e4": {"extinction_per_m": 5.0},
    "white and deep": {"co_albedo": 0.0, "extinction_per_m": 5.0},
    "sun at the horizon": {"zenith": 90.0},
    "sun below": {"zenith": 100.0},
    "all clear": {"mask": -1e4},
    "all cloudy": {"mask": 1e4},
}


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_derivatives_of_physical_light_are_right(case):
    both, one = _compiled()
    data = _data(case.get("zenith", 50.0), case.get("mask", 0.0))
    changes = {k: v for k, v in case.items() if k in NAMES}
    x = np.array(list((START | changes).values()))
    forward, reverse = both(jnp.asarray(x, jnp.float32), *data)
    assert forward.dtype == jnp.float32
    with jax.enable_x64(True):
        expected = _differences(lambda v: np.asarray(one(jnp.asarray(v), *data)), x)
    # Per tenth of a parameter, so that all count alike.
    unit = 0.1 * np.maximum(np.abs(x), 1e-3)
    forward, reverse, expected = (
        np.asarray(j) * unit for j in (forward, reverse, expected)
    )
    scale = max(np.abs(expected).max(), 1e-3)
    np.testing.assert_allclose(forward, reverse, rtol=1e-3, atol=1e-4 * scale)
    np.testing.assert_allclose(forward, expected, rtol=0.01, atol=2e-3 * scale)
