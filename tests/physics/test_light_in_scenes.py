"""Physical light through whole scenes: energy, reciprocity, layers that echo."""

import dataclasses
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import PlaneParallel, Rays, Scene, Shell, Slabs
from cloudjax.geometry.geodesy import ecef, up
from cloudjax.light.phase import HenyeyGreenstein
from tests.helpers import (
    fractal_cloud,
    layer,
    make_background,
    make_scene,
    numbers,
    rays_to,
    reflective_bands,
    seen_along,
)


FULL: dict[str, Any] = {"mask_gain": 0.0, "threshold": -30.0, "barrier_strength": 0.0}
LATITUDE, LONGITUDE = np.array([20.0]), np.array([10.0])
GROUND, VERTICAL = ecef(LATITUDE, LONGITUDE, np.zeros(1)), up(LATITUDE, LONGITUDE)[0]
EAST = np.cross([0, 0, 1.0], VERTICAL) / np.linalg.norm(np.cross([0, 0, 1], VERTICAL))
NORTH = np.cross(VERTICAL, EAST)
LOW, HIGH = Shell(1000.0, 1200.0), Shell(2000.0, 2200.0)
NETWORKS, ASYMMETRY = PlaneParallel.load(), 0.85


def directions(cosine, azimuth):
    """Unit vectors away from the place, [n 3]."""
    cosine, azimuth = np.broadcast_arrays(cosine, azimuth)
    sine = np.sqrt(1 - cosine**2)
    flat = np.cos(azimuth)[:, None] * NORTH + np.sin(azimuth)[:, None] * EAST
    return cosine[:, None] * VERTICAL + sine[:, None] * flat


def rays_from(away: np.ndarray) -> Rays:
    return rays_to(GROUND + 8e5 * away, GROUND)


def scene_of(*depths: float, co_albedo=0.0) -> Scene:
    """Full layers of vertical optical depths, from below."""
    layers = [
        layer(
            fractal_cloud(shell, **FULL),
            extinction_per_m=depth / (shell.top_m - shell.bottom_m),
            co_albedo=[co_albedo],
            asymmetry=[ASYMMETRY],
            emissive=0,
        )
        for shell, depth in zip((LOW, HIGH), depths, strict=False)
    ]
    return dataclasses.replace(
        make_scene(layers, reflective_bands(1)), reflection=Slabs(NETWORKS)
    )


def factor(scene: Scene, rays: Rays, sun, surface=0.0) -> np.ndarray:
    """πL/(μ₀E) of a scene above a Lambertian surface of an albedo."""
    assert scene.reflective is not None
    height = float(sun @ VERTICAL)
    level = surface * height / float(scene.reflective.reflectance_per_radiance[0])
    background = make_background(scene, len(rays), reflected=level)
    seen = seen_along(scene, rays, sun, background).reflective
    assert seen is not None
    return np.asarray(scene.reflective.reflectance(seen)[0]) / height


SUN = directions(0.6, np.zeros(1))[0]
COSINES = np.array([0.95, 0.7, 0.45])


def slab(depth, cosine, co_albedo=0.0):
    """Depth, particles and cosine as the networks take them."""
    depth = np.full_like(cosine, depth)
    phase = HenyeyGreenstein(jnp.asarray(ASYMMETRY))
    return numbers(*depth), jnp.asarray(co_albedo), phase, numbers(*cosine)


@pytest.mark.parametrize("depth", [1.0, 10.0])
def test_energy_is_kept_through_a_scene(depth):
    """Geometry: a full layer without absorption over a white surface, sun at 53
    degrees, seen from 8 zenith angles by 12 azimuths.

    Expectation: all light comes back, ∫ρ μ dμ dφ/π = 1, for R + T = 1 both ways.
    Source: conservation of energy. Tolerance: 1.5 %, the bidirectional network's and
    the quadrature's.
    """
    nodes, weights = np.polynomial.legendre.leggauss(8)
    cosine, share = (nodes + 1) / 2, weights / 2
    azimuth = np.arange(12) * np.pi / 6
    away = directions(np.repeat(cosine, 12), np.tile(azimuth, 8))
    ρ = factor(scene_of(depth), rays_from(away), SUN, surface=1.0).reshape(8, 12)
    flux = 2 * (share * cosine * ρ.mean(1)).sum()
    assert flux == pytest.approx(1, abs=0.015)


def test_sun_and_viewer_may_be_swapped():
    """Geometry: two layers over a surface of 0.3, sun and viewer swapped.

    Expectation: the same πL/(μ₀E). Source: Helmholtz. Tolerance: 0.3 %, because the
    rays enter the layers up to 4 km beside the place and its vertical.
    """
    scene = scene_of(3.0, 0.5, co_albedo=0.01)
    for view in directions(COSINES, np.array([0.4, 1.9, 3.0])):
        there = factor(scene, rays_from(view[None]), SUN, surface=0.3)
        back = factor(scene, rays_from(SUN[None]), view, surface=0.3)
        np.testing.assert_allclose(there, back, rtol=3e-3)


def test_two_layers_echo():
    """Geometry: a bright layer (τ = 20) below a thin one (τ = 2), black surface.

    Expectation: ρ₂ + t₂(μ₀) t₂(μ) A/(1 - A r₂), A the reflectance of the lower layer
    alone, ρ, t and r of the upper one. Source: adding of layers (Liou 2002, eq.
    6.3.31). Tolerance: 0.3 %, for the view's cosine differs between the layers. One
    layer of τ = 22 is brighter by 7 to 11 %, for light leaves the upper one mostly
    forwards and the lower one is not Lambertian: two layers hold that within 12 %.
    """
    rays = rays_from(directions(COSINES, np.array([1.0, 1.0, 1.0])))
    lower, upper = factor(scene_of(20.0), rays, SUN), factor(_above(2.0), rays, SUN)
    through = [
        np.asarray(_fluxes(NETWORKS, *slab(2.0, cosine))[1])
        for cosine in (np.full(3, 0.6), COSINES)
    ]
    back = np.asarray(NETWORKS.spherical_albedo(*slab(2.0, COSINES)[:3]))
    expected = upper + lower * through[0] * through[1] / (1 - lower * back)
    both = factor(scene_of(20.0, 2.0), rays, SUN)
    np.testing.assert_allclose(both, expected, rtol=3e-3)
    np.testing.assert_allclose(both, factor(scene_of(22.0), rays, SUN), rtol=0.12)


def _above(depth: float) -> Scene:
    """The upper layer alone."""
    scene = scene_of(0.0, depth)
    return dataclasses.replace(scene, layers=scene.layers[1:])


_fluxes = eqx.filter_jit(PlaneParallel.albedo_and_transmittance)
