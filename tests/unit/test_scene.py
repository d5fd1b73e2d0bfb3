"""Scenes: limits that need no renderer, and what is left out of the computation."""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import (
    BandRadiances,
    Rays,
    Scene,
    Shell,
    TemperatureGrid,
    TemperatureProfile,
    TwoFlux,
    products,
    radiances,
)
from cloudjax.geometry.latlon_grid import LatLonGrid
from cloudjax.march.radiances import under_air
from cloudjax.march.view import make_textures, sample
from tests.helpers import (
    arrays,
    emissive_bands,
    fractal_cloud,
    geostationary_rays,
    lay_along,
    layer,
    make_background,
    make_scene,
    over,
    reflective_bands,
    seen_along,
    sun,
    view_along,
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
    scene: Scene, zenith=30.0, masks=None, behind=(20.0, 100.0), **view
) -> BandRadiances:
    background = make_background(scene, RAYS, *behind)
    return seen_along(scene, _rays(), sun(zenith), background, masks, **view)


def test_an_opaque_isothermal_cloud_is_a_black_body():
    scene = _scene(_layer(function=FULL, extinction_per_m=1.0))
    assert scene.emissive is not None
    _, emitted = arrays(_seen(scene))
    planck = scene.emissive.planck(jnp.asarray(250.0))
    np.testing.assert_allclose(emitted, float(planck[0]), rtol=2e-6)


def test_a_thin_isothermal_cloud_emits_what_it_absorbs():
    """Along the line of sight: B (1 - T) + T L, with T = exp(-β q length)."""
    scene = _scene(_layer(function=FULL, extinction_per_m=4e-4))
    assert scene.emissive is not None
    _, emitted = arrays(_seen(scene))
    ways = lay_along(scene, _rays(), sun(30.0)).of_sources
    passed = np.exp(-4e-4 * 0.4 * np.asarray(ways[0].path.length_m))
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
    for seen, behind in zip(arrays(_seen(scene)), arrays(background), strict=True):
        np.testing.assert_allclose(seen, behind, rtol=4e-7)


def test_a_mask_that_is_empty_leaves_no_cloud():
    scene = _scene(_layer())
    empty = arrays(_seen(scene, masks=[lambda φ, λ: 0 * φ - 40.0]))
    for seen, behind in zip(empty, arrays(make_background(scene, RAYS)), strict=True):
        np.testing.assert_allclose(seen, behind, rtol=4e-7)
    some = arrays(_seen(scene, masks=[lambda φ, λ: 0 * φ]))
    assert np.abs(some[1] - empty[1]).max() > 1


def test_a_mask_in_places_leaves_clouds_there():
    scene = _scene(_layer())
    _, seen = arrays(_seen(scene, masks=[lambda φ, λ: np.where(φ > 20, 9.0, -40.0)]))
    latitude = _rays().ground()[0].latitude_deg
    clear = np.abs(seen[0] - 100) < 1e-3
    assert clear[latitude < 19.9].all()
    assert not clear[latitude > 20.1].any()


def test_an_opaque_cloud_hides_what_is_behind():
    scene = _scene(_layer(function=FULL, extinction_per_m=10.0))
    dark, bright = (
        arrays(_seen(scene, behind=b)) for b in ((0.0, 0.0), (500.0, 300.0))
    )
    for a, b in zip(dark, bright, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-4)
        assert np.all(a > 0)


def test_the_air_above_dims_the_cloud_and_adds_its_own_light():
    plain, aired = (
        arrays(_seen(_scene(_layer(function=FULL, extinction_per_m=10.0), **air)))
        for air in ({}, {"path": 0.05, "gain": 0.8})
    )
    scene = _scene(_layer(), path=0.05, gain=0.8)
    assert scene.reflective is not None
    own = np.asarray(scene.reflective.radiance(jnp.full((2, 1), 0.05)))
    np.testing.assert_allclose(aired[0], 0.8 * plain[0] + own, rtol=1e-4)
    np.testing.assert_allclose(aired[1], 0.8 * plain[1] + 0.05, rtol=1e-5)


def test_night_leaves_thermal_light_alone():
    scene = _scene(_layer(function=FULL, extinction_per_m=10.0))
    by_day, by_night = (arrays(_seen(scene, zenith)) for zenith in (30.0, 120.0))
    np.testing.assert_array_equal(by_night[1], by_day[1])
    np.testing.assert_allclose(by_night[0], 0, atol=1e-6)
    assert by_day[0].min() > 10


@pytest.mark.parametrize("asked", [True, False], ids=["visible", "thermal"])
def test_what_is_not_asked_is_not_computed(asked):
    bands = (reflective_bands(1), None) if asked else (None, emissive_bands(13))
    scene = make_scene([layer(fractal_cloud())], *bands)
    ways = lay_along(scene, _rays(), sun(30.0))

    def run(scene, ways, textures):
        view = sample(scene, ways, textures)
        occupancy = scene.layers[0].cloud.occupancy(
            view.samples[0], scene.layers[0].steps
        )
        return view.samples[0], occupancy, radiances(scene, view)

    samples, occupancy, seen = eqx.filter_eval_shape(
        run, scene, ways, make_textures(scene)
    )
    assert (samples.gradients is not None) == asked
    assert (samples.up is not None) == asked
    assert (occupancy.slopes is not None) == asked
    assert (seen.reflective is not None) == asked
    assert (seen.emissive is None) == asked


def _shapes(scene: Scene) -> BandRadiances:
    scene = over(scene, make_background(scene, RAYS))
    ways = lay_along(scene, _rays(), sun(30.0))

    def seen(scene, ways, textures):
        return radiances(scene, sample(scene, ways, textures))

    return eqx.filter_eval_shape(seen, scene, ways, make_textures(scene))


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
        def __call__(self, optical_depth, particles, light):
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


@pytest.mark.parametrize(("first_m", "second_m"), [(8e3, 1e3), (1e3, 8e3)])
def test_the_upper_layer_hides_the_lower_in_any_order(first_m, second_m):
    """A cold opaque layer above a warm one, seen from space."""
    planck = emissive_bands(13).planck(jnp.asarray([220.0, 290.0]))[0]
    scene = _two(first_m, second_m, [290.0, 290.0, 220.0, 220.0], 10.0)
    seen = _seen(scene).emissive
    assert seen is not None
    np.testing.assert_allclose(seen, planck[0], rtol=1e-5)


def test_layers_multiply_their_transmittances():
    """Two haze layers over a background, in the infrared, by hand."""
    scene = _two(8e3, 1e3, [250.0] * 4, 3e-4)
    found = _seen(scene).emissive
    assert found is not None
    assert scene.emissive is not None
    ways = lay_along(scene, _rays(), sun(30.0)).of_sources
    t = [np.exp(-3e-4 * 0.4 * np.asarray(way.path.length_m)) for way in ways]
    b = float(scene.emissive.planck(jnp.asarray(250.0))[0])
    expected = b * (1 - t[0]) + t[0] * (b * (1 - t[1]) + t[1] * 100)
    np.testing.assert_allclose(found[0], expected, rtol=1e-5)


def test_a_scene_without_bands_is_refused():
    with pytest.raises(ValueError, match="ask at least one"):
        make_scene([layer(fractal_cloud())])


def _products(scene: Scene):
    return products(scene, view_along(scene, _rays(), sun(30.0)))


def test_products_of_a_full_cloud_are_those_of_a_slab():
    """Vertical depth βΔz, the height of the lid, all cover, and layer 1 of 2.

    The shell is a kilometre thick, rays are 25 degrees from the vertical: the curvature
    within it changes the cosine by less than 1e-4. At an extinction of 0.1 per metre
    a ray is stopped within a few tens of metres, here within the first step of 83 m.
    """
    scene = _two(8e3, 1e3, [250.0] * 4, 0.1)
    clouds = _products(scene)
    np.testing.assert_allclose(clouds.fraction, 1, atol=1e-4)
    np.testing.assert_allclose(clouds.optical_depth, 200, rtol=1e-3)
    np.testing.assert_allclose(clouds.top_height_m, 9e3, atol=45)
    np.testing.assert_allclose(clouds.share[0], 1, atol=1e-4)
    np.testing.assert_allclose(clouds.share[1], 0, atol=1e-4)


def test_products_of_clear_air_have_no_height():
    clouds = _products(_scene(_layer(function={"threshold": 30.0})))
    assert jnp.isnan(clouds.top_height_m).all()
    for field in (clouds.fraction, clouds.optical_depth, clouds.share):
        np.testing.assert_allclose(field, 0, atol=1e-6)


def test_half_a_cover_is_where_the_depth_is_visible():
    """The soft cover is a half at an optical depth of 0.3, in a shell of 3500 m."""
    scene = _scene(_layer(function=FULL, extinction_per_m=0.3 / 3500))
    np.testing.assert_allclose(_products(scene).fraction, 0.5, atol=1e-3)


def test_some_rays_of_a_view_are_sampled_as_they_are_alone():
    scene, rays = _scene(_layer()), _rays()
    whole = view_along(scene, rays, sun(30.0))
    for some in (slice(0, 10), np.array([3, 30, 11])):
        part, alone = whole[some], view_along(scene, rays[some], sun(30.0))
        assert len(part) == len(alone) == len(rays[some])
        assert jax.tree.structure(part) == jax.tree.structure(alone)
        for a, b in zip(jax.tree.leaves(part), jax.tree.leaves(alone), strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-5, atol=1e-5)


def test_air_that_differs_from_place_to_place_warms_the_cloud():
    """A black cloud as warm as the latitude says, 250 K + 10 K per degree."""
    scene = _scene(_layer(function=FULL, extinction_per_m=1.0))
    latitude, longitude = np.arange(10.0, 31.0), np.arange(0.0, 21.0)
    kelvin = 250 + 10 * (latitude - 20)[:, None, None] + np.zeros((21, 21, 2))
    air = TemperatureGrid(
        jnp.asarray(kelvin, float), LatLonGrid.from_axes(latitude, longitude), 20e3
    )
    scene = dataclasses.replace(scene, temperature=air)
    assert scene.emissive is not None
    _, emitted = arrays(_seen(scene))
    kelvin = 250 + 10 * (_rays().ground()[0].latitude_deg - 20)
    # The cloud lies 4 km above the ground: a hundredth of a degree.
    low, high = (scene.emissive.planck(jnp.asarray(kelvin + d)) for d in (-1.0, 1.0))
    assert np.all((emitted > low) & (emitted < high))


def test_light_beside_the_earth_is_never_negative():
    """Between two bright clouds more than all light is passed on; of none, none.

    Radiances of -30 W m-2 sr-1 um-1 were found where a ray passes the limb.
    """
    none, path = jnp.zeros((1, 3)), jnp.full((1, 1), 0.1)
    passed = jnp.asarray([[0.0, 0.5, 3.0]])
    seen = under_air(none, passed, none, path, jnp.ones(1))
    np.testing.assert_allclose(seen[0], [0.1, 0.05, 0.0], atol=1e-7)
    # Over bright ground it is as bright as it is.
    bright = under_air(none, passed, none + 0.6, path, jnp.ones(1))
    np.testing.assert_allclose(bright[0], [0.1, 0.35, 1.6], rtol=1e-6)
