"""What is done to all ways alike is compiled once and skipped where nothing is met."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import Shadows, look, radiances
from cloudjax.clouds.fractal import FractalCloud
from cloudjax.march.alike import each_met
from cloudjax.march.view import lay
from tests.helpers import (
    GEOSTATIONARY_M,
    FunctionMask,
    TurnedAir,
    emissive_bands,
    fractal_cloud,
    ground_points,
    layer,
    make_scene,
    rays_to,
    reflective_bands,
    sampling,
    sun,
)


RAYS = rays_to(GEOSTATIONARY_M, ground_points(12, 20.0, 10.0, 0.08))
SUN = sun(50.0)


def _root(x):
    return jnp.sqrt(x)


def test_items_of_several_shapes_come_back_in_their_order():
    items = [jnp.full(2, 4.0), jnp.full(3, 9.0), jnp.full(2, 16.0)]
    found = each_met([jnp.asarray(True)] * 3, _root, jnp.zeros_like, items)
    assert [x.shape for x in found] == [(2,), (3,), (2,)]
    np.testing.assert_allclose([x[0] for x in found], [2.0, 3.0, 4.0])


def test_what_is_not_met_is_not_computed():
    """A root of -1 is NaN where it is computed, and so is its derivative."""
    met = [jnp.asarray(True), jnp.asarray(False), jnp.asarray(True)]

    def total(x):
        items = [x * jnp.ones(2), -x * jnp.ones(2), -x * jnp.ones(3)]
        return each_met(met[:2], _root, jnp.zeros_like, items[:2])

    value, slope = jax.jvp(total, (4.0,), (1.0,))
    np.testing.assert_allclose(value, [[2.0, 2.0], [0.0, 0.0]])
    np.testing.assert_allclose(slope, [[0.25, 0.25], [0.0, 0.0]])
    backward = jax.grad(lambda x: sum(part.sum() for part in total(x)))(4.0)
    np.testing.assert_allclose(backward, 0.5)


def test_layers_of_one_shape_are_compiled_once():
    """Five ways cost about as many operations to compile as two."""

    def operations(ways):
        items = [jnp.full(4, float(i)) for i in range(ways)]
        met = [x[0] > 0 for x in items]
        made = jax.jit(lambda: each_met(met, twenty, jnp.zeros_like, items))
        return made.lower().as_text().count("stablehlo.sine")

    def twenty(x):
        for _ in range(20):
            x = jnp.sin(x)
        return x

    assert operations(5) == operations(2) == 20


def _clear_or(mask: float) -> FractalCloud:
    clear = FunctionMask(lambda latitude, longitude: 0 * latitude + mask)
    return replace(fractal_cloud(nodes=3), mask=clear)


@pytest.mark.parametrize("mask", [-60.0, 0.0])
def test_a_layer_whose_mask_is_clear_changes_nothing(mask):
    """With -60 it has no likelihood at all and is skipped; with 0 it counts."""
    lit = {"reflective": reflective_bands(2), "emissive": emissive_bands(13)}
    one = layer(fractal_cloud(nodes=3))
    other = layer(replace(_clear_or(mask), seed=7))
    alone, both = (make_scene(some, **lit) for some in ([one], [one, other]))
    seen = [radiances(scene, look(scene, RAYS, SUN)) for scene in (alone, both)]
    reflective = [np.asarray(x.reflective) for x in seen]
    emissive = [np.asarray(x.emissive) for x in seen]
    if mask < 0:
        np.testing.assert_allclose(*reflective, rtol=2e-6)
        np.testing.assert_allclose(*emissive, rtol=2e-6)
    else:
        assert np.abs(reflective[0] - reflective[1]).max() > 1e-3


def test_strain_of_the_wind_is_found_only_where_it_is_asked():
    """By shadows, which branch off, and by light that sees slopes."""
    cloud = replace(fractal_cloud(), displacements=(TurnedAir.by(2.0), None))
    plain = make_scene([layer(cloud)], reflective=None, emissive=emissive_bands(13))
    shaded = replace(plain, shadows=Shadows())

    def strain(scene):
        return lay(scene, RAYS, SUN, sampling(2e3)).of_sources[0].strain

    assert strain(plain) is None
    assert strain(shaded) is not None
