"""Scenes: limits that need no renderer, and what is left out of the computation."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import Rays, Scene, Shell, TemperatureProfile, TwoFlux
from cloudjax.scene import BandRadiances, navigate, radiances, render, sample
from tests.helpers import (
    emissive_bands,
    fractal_cloud,
    geostationary_rays,
    layer,
    make_background,
    make_scene,
    make_textures,
    reflective_bands,
    sun,
)


RAYS = 37
FULL: dict[str, Any] = {"mask_gain": 0.0, "threshold": -30.0, "barrier_strength": 0.0}


def _isothermal(kind=TemperatureProfile) -> TemperatureProfile:
    return kind(jnp.asarray([0.0, 2e4]), jnp.asarray([250.0, 250.0]))


def _rays() -> Rays:
    return geostationary_rays(RAYS)


def _scene(*layers, indirect=0.2, path=0.0, gain=1.0) -> Scene:
    return make_scene(
        layers,
        reflective_bands(1, 5, path=path, gain=gain),
        emissive_bands(13, path=path, gain=gain),
        indirect=indirect,
        temperature=_isothermal(),
    )


def _layer(low=500.0, high=4000.0, function=None, **changes):
    cloud = fractal_cloud(Shell(low, high), **(function or {}))
    return layer(cloud, reflective=2, **changes)


def _seen(
    scene: Scene, zenith=30.0, masks=None, tile=64, behind=(20.0, 100.0)
) -> BandRadiances:
    view = navigate(scene, _rays(), sun(zenith), masks=masks)
    background = make_background(scene, RAYS, *behind)
    return render(scene, view, make_textures(scene), background, tile=tile)


def _arrays(seen: BandRadiances):
    assert seen.reflective is not None
    assert seen.emissive is not None
    return np.asarray(seen.reflective), np.asarray(seen.emissive)


def test_an_opaque_isothermal_cloud_is_a_black_body():
    scene = _scene(_layer(function=FULL, extinction_per_m=1.0))
    assert scene.emissive is not None
    _, emitted = _arrays(_seen(scene))
    planck = scene.emissive.planck(jnp.asarray(250.0))
    np.testing.assert_allclose(emitted, float(planck[0]), rtol=2e-6)


def test_a_thin_isothermal_cloud_emits_what_it_absorbs():
    """Along the line of sight: B (1 - T) + T L, with T = exp(-β q length)."""
    scene = _scene(_layer(function=FULL, extinction_per_m=4e-4))
    assert scene.emissive is not None
    _, emitted = _arrays(_seen(scene))
    view = navigate(scene, _rays(), sun(30.0))
    passed = np.exp(-4e-4 * 0.4 * np.asarray(view.ways[0].path.length_m))
    planck = float(scene.emissive.planck(jnp.asarray(250.0))[0])
    np.testing.assert_allclose(
        emitted[0], planck * (1 - passed) + 100 * passed, rtol=1e-5
    )


@pytest.mark.parametrize("cloud", [{}, {"function": FULL, "extinction_per_m": 0.0}])
@pytest.mark.parametrize("path", [0.0, 0.1])
def test_clear_air_shows_the_background(cloud, path):
    """No occupied step, or no extinction: the background to float32 rounding."""
    clear = {"function": {"threshold": 30.0}} | cloud
    scene = _scene(_layer(**clear), path=path, gain=0.9)
    background = make_background(scene, RAYS)
    for seen, behind in zip(_arrays(_seen(scene)), _arrays(background), strict=True):
        np.testing.assert_allclose(seen, behind, rtol=4e-7)


def test_a_mask_that_is_empty_leaves_no_cloud():
    scene = _scene(_layer())
    empty = _arrays(_seen(scene, masks=[lambda φ, λ: 0 * φ - 40.0]))
    for seen, behind in zip(empty, _arrays(make_background(scene, RAYS)), strict=True):
        np.testing.assert_allclose(seen, behind, rtol=4e-7)
    some = _arrays(_seen(scene, masks=[lambda φ, λ: 0 * φ]))
    assert np.abs(some[1] - empty[1]).max() > 1


def test_a_mask_in_places_leaves_clouds_there():
    scene = _scene(_layer())
    _, seen = _arrays(_seen(scene, masks=[lambda φ, λ: np.where(φ > 20, 9.0, -40.0)]))
    latitude = _rays().ground()[0].latitude_deg
    clear = np.abs(seen[0] - 100) < 1e-3
    assert clear[latitude < 19.9].all()
    assert not clear[latitude > 20.1].any()


def test_an_opaque_cloud_hides_what_is_behind():
    scene = _scene(_layer(function=FULL, extinction_per_m=10.0))
    dark, bright = (
        _arrays(_seen(scene, behind=b)) for b in ((0.0, 0.0), (500.0, 300.0))
    )
    for a, b in zip(dark, bright, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-4)
        assert np.all(a > 0)


def test_the_air_above_dims_the_cloud_and_adds_its_own_light():
    plain, aired = (
        _arrays(_seen(_scene(_layer(function=FULL, extinction_per_m=10.0), **air)))
        for air in ({}, {"path": 0.05, "gain": 0.8})
    )
    scene = _scene(_layer(), path=0.05, gain=0.8)
    assert scene.reflective is not None
    own = np.asarray(scene.reflective.radiance(jnp.full((2, 1), 0.05)))
    np.testing.assert_allclose(aired[0], 0.8 * plain[0] + own, rtol=1e-4)
    np.testing.assert_allclose(aired[1], 0.8 * plain[1] + 0.05, rtol=1e-5)


def test_night_leaves_thermal_light_alone():
    scene = _scene(_layer(function=FULL, extinction_per_m=10.0))
    by_day, by_night = (_arrays(_seen(scene, zenith)) for zenith in (30.0, 120.0))
    np.testing.assert_array_equal(by_night[1], by_day[1])
    np.testing.assert_allclose(by_night[0], 0, atol=1e-6)
    assert by_day[0].min() > 10


def test_the_result_does_not_depend_on_the_tile():
    scene = _scene(_layer())
    whole, parts = (_arrays(_seen(scene, tile=tile)) for tile in (64, 5))
    for a, b in zip(whole, parts, strict=True):
        np.testing.assert_allclose(a, b, rtol=2e-5)


def test_rays_that_fill_the_last_tile_do_not_spoil_gradients():
    scene = make_scene([layer(fractal_cloud())], None, emissive_bands(13))
    view = navigate(scene, _rays(), sun(30.0))
    textures, background = make_textures(scene), make_background(scene, RAYS)

    def total(layers):
        changed = eqx.tree_at(lambda s: s.layers, scene, layers)
        seen = render(changed, view, textures, background, tile=20)
        assert seen.emissive is not None
        return seen.emissive.mean()

    slope = jax.grad(total)(scene.layers)
    assert all(jnp.isfinite(leaf).all() for leaf in jax.tree.leaves(slope))
    assert float(slope[0].extinction_per_m) != 0


@pytest.mark.parametrize("asked", [True, False], ids=["visible", "thermal"])
def test_what_is_not_asked_is_not_computed(asked):
    bands = (reflective_bands(1), None) if asked else (None, emissive_bands(13))
    scene = make_scene([layer(fractal_cloud())], *bands)
    view = navigate(scene, _rays(), sun(30.0))

    def run(scene, view, textures, background):
        samples = sample(scene, view, textures)
        occupancy = scene.layers[0].cloud.occupancy(samples[0])
        return samples[0], occupancy, radiances(scene, view, samples, background)

    samples, occupancy, seen = eqx.filter_eval_shape(
        run, scene, view, make_textures(scene), make_background(scene, RAYS)
    )
    assert (samples.texture_gradients is not None) == asked
    assert (samples.up is not None) == asked
    assert (occupancy.gradient is not None) == asked
    assert (seen.reflective is not None) == asked
    assert (seen.emissive is None) == asked


def _shapes(scene: Scene) -> BandRadiances:
    view = navigate(scene, _rays(), sun(30.0))
    background = make_background(scene, RAYS)
    return eqx.filter_eval_shape(render, scene, view, make_textures(scene), background)


def test_a_visible_scene_never_asks_for_the_temperature():
    class Forbidden(TemperatureProfile):
        def __call__(self, altitude_m):
            raise AssertionError("no emission was asked")

    scene = make_scene(
        [layer(fractal_cloud())],
        reflective_bands(1),
        None,
        temperature=_isothermal(Forbidden),
    )
    seen = _shapes(scene)
    assert seen.reflective is not None
    assert seen.reflective.shape == (1, RAYS)


def test_a_thermal_scene_never_asks_for_the_sun():
    class Forbidden(TwoFlux):
        def __call__(self, optical_depth, co_albedo, facing, sun_height):
            raise AssertionError("no reflection was asked")

    scene = make_scene([layer(fractal_cloud())], None, emissive_bands(13))
    scene = eqx.tree_at(lambda s: s.reflection, scene, Forbidden(jnp.asarray(0.0)))
    assert _shapes(scene).reflective is None


def _two(first_m, second_m, kelvin, extinction_per_m) -> Scene:
    """Full layers of a kilometre, in the infrared."""
    clouds = [fractal_cloud(Shell(z, z + 1e3), **FULL) for z in (first_m, second_m)]
    layers = [layer(cloud, extinction_per_m=extinction_per_m) for cloud in clouds]
    air = TemperatureProfile(jnp.asarray([0.0, 5e3, 5001.0, 2e4]), jnp.asarray(kelvin))
    return make_scene(layers, None, emissive_bands(13), temperature=air)


def test_the_first_layer_hides_the_second():
    """A cold opaque layer above a warm one, then the other way round."""
    planck = emissive_bands(13).planck(jnp.asarray([220.0, 290.0]))[0]
    for heights, expected in (((8e3, 1e3), planck[0]), ((1e3, 8e3), planck[1])):
        seen = _seen(_two(*heights, [290.0, 290.0, 220.0, 220.0], 10.0)).emissive
        assert seen is not None
        np.testing.assert_allclose(seen, expected, rtol=1e-5)


def test_layers_multiply_their_transmittances():
    """Two haze layers over a background, in the infrared, by hand."""
    scene = _two(8e3, 1e3, [250.0] * 4, 3e-4)
    found = _seen(scene).emissive
    assert found is not None
    assert scene.emissive is not None
    view = navigate(scene, _rays(), sun(30.0))
    t = [np.exp(-3e-4 * 0.4 * np.asarray(w.path.length_m)) for w in view.ways]
    b = float(scene.emissive.planck(jnp.asarray(250.0))[0])
    expected = b * (1 - t[0]) + t[0] * (b * (1 - t[1]) + t[1] * 100)
    np.testing.assert_allclose(found[0], expected, rtol=1e-5)


def test_a_scene_without_bands_is_refused():
    with pytest.raises(ValueError, match="ask at least one"):
        make_scene([layer(fractal_cloud())])
