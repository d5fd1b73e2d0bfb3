"""Radiances follow the effective radius of a layer's particles, with derivatives.

All through the public path: `put`, `look` and `radiances`.
"""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import (
    ClassTexture,
    Gaussian,
    GivenOptics,
    Ladder,
    TwoFlux,
    class_layer,
    imagery_classes,
    look,
    make_scene,
    put,
    radiances,
)
from cloudjax.light.optics import radius_limits_um
from tests.helpers import fractal_cloud, geostationary_rays, reflective_bands, sun
from tests.helpers import layer as given_layer
from tests.helpers import make_scene as scene_of


# 3.9 µm by day is in both parts of the scene.
BANDS = (5, 7, 13)
# Two rungs, to compile in no time.
COARSE = ClassTexture(Ladder(Gaussian(), 15e3, 7.5e3), 1.0, 0.5, 0.0)
WATER, ICE = (
    replace(imagery_classes()[name], textures=(COARSE,), priors={})
    for name in ("low_stratus", "cirrus")
)
RADII = jnp.asarray([one.effective_radius_um for one in (ICE, WATER)])


def _path(one):
    return f"{one.name}.optics.particles.effective_radius_um"


def _scene(*classes):
    """In the paper's light, which compiles in no time."""
    scene = make_scene(BANDS, classes, cover=0.8, air=False, steps=4)
    return replace(scene, reflection=TwoFlux(jnp.asarray(0.3)), emission=None)


def _view(scene):
    return look(scene, geostationary_rays(4), sun(50.0))


def _with_radii(scene, radii_um):
    return put(scene, {_path(ICE): radii_um[0], _path(WATER): radii_um[1]})


def _seen(radii_um, scene, view):
    """Mean radiance of each band, of each part of the scene."""
    seen = radiances(_with_radii(scene, radii_um), view)
    assert seen.reflective is not None
    assert seen.emissive is not None
    return jnp.concatenate([part.mean(1) for part in (seen.reflective, seen.emissive)])


_BOTH = jax.jit(lambda *a: (jax.jacfwd(_seen)(*a), jax.jacrev(_seen)(*a)))


def test_derivatives_by_radii_are_those_of_the_public_path():
    """Both modes in float32; differences in float64 look anew at each scene."""
    scene = _scene(ICE, WATER)
    forward, reverse = (np.asarray(j) for j in _BOTH(RADII, scene, _view(scene)))
    assert forward.dtype == np.float32
    with jax.enable_x64(True):
        scene, at, seen = _scene(ICE, WATER), np.asarray(RADII, float), jax.jit(_seen)
        columns = []
        for step in 1e-4 * np.eye(2):
            ends = []
            for radii_um in (jnp.asarray(at - step), jnp.asarray(at + step)):
                view = _view(_with_radii(scene, radii_um))
                ends.append(np.asarray(seen(radii_um, scene, view)))
            columns.append((ends[1] - ends[0]) / 2e-4)
    expected = np.stack(columns, -1)
    assert expected.dtype == np.float64
    np.testing.assert_allclose(forward, reverse, rtol=1e-3)
    np.testing.assert_allclose(forward, expected, rtol=1e-2)
    # Larger particles are darker where they absorb sunlight: 1.6 and 3.9 µm.
    assert (forward[:2] < 0).all()


def test_derivatives_are_finite_at_the_ends_of_the_table():
    scene = _scene(ICE, WATER)
    view = _view(scene)
    limits = np.array([radius_limits_um(one.particles) for one in (ICE, WATER)])
    for radii_um in (limits[:, 0] / 2, limits[:, 0], limits[:, 1], limits[:, 1] * 2):
        for found in _BOTH(jnp.asarray(radii_um, float), scene, view):
            assert jnp.isfinite(found).all()


@pytest.mark.parametrize("one", [WATER, ICE], ids=["water", "ice"])
def test_a_radius_put_into_a_scene_is_that_of_its_class(one):
    other = replace(one, effective_radius_um=1.5 * one.effective_radius_um)
    scene, expected = _scene(one), _scene(other)
    found = put(scene, {_path(one): other.effective_radius_um})
    for a, b in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("share", [1.0, 0.075])
def test_the_infrared_follows_the_radius_unless_the_class_has_its_own_ratio(share):
    bands = {"sunlit": (5,), "thermal": (13, 15), "extinction_share": share}
    coarse = replace(WATER, effective_radius_um=20.0)
    fine, large = (class_layer(one, **bands) for one in (WATER, coarse))
    held = class_layer(replace(coarse, infrared_ratio=0.4), **bands)
    for layer, one in ((fine, WATER), (large, coarse)):
        absorbed = one.extinction_per_m * float(one.optics.infrared_ratio)
        assert float(layer.absorptions_per_m[0]) == pytest.approx(absorbed, rel=1e-5)
    # Over what they scatter, larger droplets absorb more.
    assert float(large.absorptions_per_m[0]) > 1.2 * float(fine.absorptions_per_m[0])
    own = 0.4 * WATER.extinction_per_m
    assert float(held.absorptions_per_m[0]) == pytest.approx(own, rel=1e-5)
    # Sunlight follows the radius all the same.
    np.testing.assert_array_equal(
        held.optics.scatterers.co_albedo, large.optics.scatterers.co_albedo
    )


def test_given_numbers_without_a_thermal_part_are_refused_where_it_is_asked():
    optics = GivenOptics(jnp.zeros(1))
    with pytest.raises(ValueError, match="in the thermal bands: give both"):
        _ = optics.emitters
    with pytest.raises(ValueError, match="in the thermal bands: give infrared_ratio"):
        _ = optics.absorption


def test_a_layer_of_sunlight_alone_needs_no_thermal_numbers():
    full = given_layer(fractal_cloud(), emissive=0)
    short = replace(full, optics=GivenOptics(jnp.full(1, 0.01)))
    scenes = [scene_of([one], reflective_bands(1)) for one in (full, short)]
    seen = [radiances(scene, _view(scene)).reflective for scene in scenes]
    np.testing.assert_array_equal(*seen)
