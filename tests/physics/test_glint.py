"""The sun's mirror image in the sea."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import GriddedCloud, Scene, Shell, look, radiances
from cloudjax.geometry.geodesy import up
from cloudjax.image.render import prepare, render
from cloudjax.light.ground import AbstractMappedGround, GroundSamples, Lambertian
from cloudjax.light.sea import fresnel, glint, slope_variance
from tests.helpers import (
    GEOSTATIONARY_M,
    ground_points,
    layer,
    make_scene,
    rays_to,
    reflective_bands,
    sun,
)


WATER = 1.331
SUN = sun(40.0)
ASYMMETRY, CO_ALBEDO = 0.85, 0.01


def _hemisphere(sun_deg, wind_m_s, zeniths=4000, azimuths=720):
    """The reflectance factor to all sides, and what each counts in the flux up."""
    view = (np.arange(zeniths) + 0.5) / zeniths
    azimuth = 2 * np.pi * (np.arange(azimuths) + 0.5) / azimuths
    sun = np.cos(np.radians(sun_deg))
    across = np.sqrt((1 - view**2) * (1 - sun**2))
    scattering = -(view * sun + np.cos(azimuth)[:, None] * across).ravel()
    view = np.broadcast_to(view, (azimuths, zeniths)).ravel()
    ones = np.ones_like(view)
    variance = slope_variance(jnp.asarray(wind_m_s * ones))
    found = glint(
        jnp.asarray(sun * ones),
        jnp.asarray(view),
        jnp.asarray(scattering),
        variance,
        jnp.array([WATER]),
    )
    return np.asarray(found[0]), 2 * view / view.size


@pytest.mark.parametrize("sun_deg", [0.0, 30.0, 60.0])
def test_a_calm_sea_sends_back_what_a_flat_one_does(sun_deg):
    """All light sent up by a sea without wind, whose slopes of 3° remain, is Fresnel's
    share of the sun's: albedo 0.0202, 0.0211, 0.0592 for n = 1.331. Within 4 %, of
    which slopes make most at 60°.
    """
    factor, weight = _hemisphere(sun_deg, 0.0)
    height = np.cos(np.radians(sun_deg))
    expected = float(fresnel(jnp.array([height]), jnp.array([WATER]))[0])
    assert (factor * weight).sum() == pytest.approx(expected * height, rel=0.04)


def test_the_image_is_as_wide_as_the_wind_makes_it():
    """Straight above a sun overhead the factor is ρ/(4σ²), and falls to 1/e where
    facets are tilted by tan β = σ (Cox and Munk 1954): viewer at 2β. But for 1/cos θ
    of the viewer and 1/cos⁴ β. Within 1 %.
    """
    for wind in (2.0, 7.0, 14.0):
        variance = 0.003 + 0.00512 * wind
        tilt = np.arctan(np.sqrt(variance))
        view = jnp.asarray(np.cos([0.0, 2 * tilt]))
        one = jnp.ones(2)
        (found,) = np.asarray(
            glint(one, view, -view, slope_variance(wind * one), jnp.array([WATER]))
        )
        straight = float(fresnel(jnp.ones(1), jnp.array([WATER]))[0])
        assert found[0] == pytest.approx(straight / (4 * variance), rel=0.01)
        beside = np.exp(-1) / np.cos(2 * tilt) / np.cos(tilt) ** 4
        assert found[1] / found[0] == pytest.approx(beside, rel=0.01)


def test_the_sea_never_sends_back_more_than_comes():
    """Albedo below 1 for all suns, and light and derivatives finite to the horizon."""
    for sun_deg in (80.0, 88.0, 89.9):
        factor, weight = _hemisphere(sun_deg, 6.6, 400, 180)
        assert 0 < (factor * weight).sum() < np.cos(np.radians(sun_deg))

    def total(wind, height, view):
        ones = jnp.ones(2)
        angles = height * ones, view * ones, jnp.array([-1.0, 1.0])
        return glint(*angles, slope_variance(wind * ones), jnp.array([WATER])).sum()

    for height in (-0.1, 0.0, 1e-6, 1.0):
        for view in (-0.1, 0.0, 1e-6, 1.0):
            for wind in (0.0, 150.0):
                both = jax.value_and_grad(total, (0, 1, 2))(wind, height, view)
                assert np.isfinite(jax.tree.leaves(both)).all()
    assert total(5.0, -0.1, 0.5) == 0


class Mirror(AbstractMappedGround):
    """Black ground that mirrors the sun by a given factor, the same everywhere."""

    factor: float = 0.5

    def look(self, rays, places, hit, sun_direction, reflective, emissive):
        one = jnp.ones((len(hit), 1))
        properties = Lambertian(0 * one, None, 288.0 * one[:, 0], self.factor * one)
        return GroundSamples.of(places, hit, sun_direction, properties=properties)


def _over_mirror(depth) -> Scene:
    """A uniform cloud 1 km deep over the mirror."""
    cloud = GriddedCloud(
        density=jnp.ones((4, 4, 2)),
        shell=Shell(1000.0, 2000.0),
        corner_deg=(20.0, 10.0),
        spacing_m=(1e4, 1e4),
        periodic=True,
    )
    own = layer(
        cloud,
        extinction_per_m=depth / 1000.0,
        co_albedo=[CO_ALBEDO],
        asymmetry=[ASYMMETRY],
        relative_extinction=[1.0],
    )
    return make_scene([own], reflective_bands(2), ground=Mirror())


@pytest.mark.parametrize("depth", [0.0, 0.5, 3.0, 100.0])
def test_clouds_hide_the_image_of_the_sun(depth):
    """A uniform cloud over a black mirror, seen from GEO under a sun at 40°: what the
    mirror adds is its factor times exp(-τ' (1/μ + 1/μ₀)), with τ' = (1 - ω g²) τ
    (Joseph et al. 1976). Within 1 %, for the sun's height at the ground is not quite
    that at the cloud; clear sky and thick cloud are exact.
    """
    scene = _over_mirror(depth)
    rays = rays_to(GEOSTATIONARY_M, ground_points(6, 20.0, 10.0, 0.05))
    dark = dataclasses.replace(scene, ground=Mirror(0.0))
    assert scene.reflective is not None
    seen, without = (
        scene.reflective.reflectance(radiances(one, look(one, rays, SUN)).reflective)
        for one in (scene, dark)
    )
    places, _ = rays.ground()
    vertical = up(places.latitude_deg, places.longitude_deg)
    slants = 1 / (vertical @ SUN) - 1 / np.sum(vertical * rays.direction, axis=-1)
    lost = (1 - (1 - CO_ALBEDO) * ASYMMETRY**2) * depth * slants
    expected = 0.5 * np.exp(-lost)
    np.testing.assert_allclose((seen - without)[0], expected, rtol=0.01, atol=1e-6)


def _seen(scene, view):
    """The radiances of the band that sees the sun."""
    found = radiances(scene, view).reflective
    assert found is not None
    return found


def test_all_ways_to_see_the_image_agree():
    """A direct render, a prepared one, `radiances` and `vmap` over rays are equal
    within rounding, through cloud and beside it (it is 40 km wide), and the derivative
    by extinction is that of differences within 1 %.
    """
    scene = _over_mirror(0.5)
    own = scene.layers[0]
    cloud = dataclasses.replace(own.cloud, periodic=False)
    scene = dataclasses.replace(scene, layers=(dataclasses.replace(own, cloud=cloud),))
    rays = rays_to(GEOSTATIONARY_M, ground_points(40, 20.18, 10.18, 0.5))
    view = look(scene, rays, SUN)
    seen = _seen(scene, view)
    cloudless = dataclasses.replace(scene, layers=())
    clear = _seen(cloudless, look(cloudless, rays, SUN))
    through = np.asarray(seen != clear)[0]
    assert 3 < through.sum() < 37
    each = jax.vmap(_seen, in_axes=(None, 0))(scene, view).T
    images = render(scene, rays, SUN), render(scene, prepare(scene, rays, SUN))
    for found in (each, *(image.radiances.reflective for image in images)):
        assert found is not None
        np.testing.assert_allclose(found, seen, rtol=2e-5)

    def total(extinction_per_m):
        one = dataclasses.replace(scene.layers[0], extinction_per_m=extinction_per_m)
        changed = dataclasses.replace(scene, layers=(one,))
        return _seen(changed, view).sum()

    at, h = own.extinction_per_m, 2e-5
    expected = (total(at + h) - total(at - h)) / (2 * h)
    np.testing.assert_allclose(jax.grad(total)(at), expected, rtol=0.01)
