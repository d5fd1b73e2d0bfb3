"""The soft level set: its hard limit, and what it owes to sub-pixel structure."""

import dataclasses
import functools as ft

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import Rays
from cloudjax.march import first_surface, march
from cloudjax.scene import navigate, render
from tests import hard_reference
from tests.helpers import (
    fractal_cloud,
    geostationary_rays,
    layer,
    make_background,
    make_scene,
    rays_to,
    reflective_bands,
    sun,
)


STEPS = 24
RAYS = geostationary_rays(400, 25.0)


@eqx.filter_jit
def _soft(cloud, way, textures):
    samples = cloud.sample(way, textures, steps=STEPS, with_gradient=True)
    assert samples.up is not None
    passed = march(cloud.occupancy(samples), way.path.length_m)
    assert passed.gradient is not None
    absorbed = passed.absorbed(jnp.asarray(1e3, float))
    surface = first_surface(absorbed, samples.distance_m, passed.gradient, samples.up)
    return passed.depth_m[0], surface.distance_m[0], surface.normal[:, 0]


@pytest.fixture(scope="module")
def hard():
    cloud = fractal_cloud(threshold=0.6)
    textures = cloud.make_textures(0.0, 16)
    return hard_reference.march(cloud, textures, RAYS, STEPS)


@ft.cache
def _marched(smoothing: float):
    cloud = fractal_cloud(threshold=0.6, smoothing=smoothing)
    way = cloud.navigate(RAYS)
    return [np.asarray(x) for x in _soft(cloud, way, cloud.make_textures(0.0, 16))]


def test_without_width_it_is_the_papers_hard_level_set(hard):
    """Geometry: 400 rays from geostationary orbit, 24 steps, no footprint, one node.

    Expectation: way through cloud, first surface and its normal of a float64 march with
    a hard threshold (tests/hard_reference.py), as in section 2.1 of Schinder et al.
    (2024). Tolerance: one ray in a hundred may have a step so near to the threshold
    that float32 decides otherwise; the others agree to 1e-4 of a step, and normals to
    0.05 degrees.
    """
    depth, distance, normal = _marched(1e-5)
    cloudy = hard.depth_m > 0
    assert 0.2 < cloudy.mean() < 0.95
    same = np.abs(depth - hard.depth_m) < 1e-4 * hard.step_m
    assert same.mean() >= 0.99
    at = same & cloudy
    error = np.abs(distance - hard.distance_m)
    np.testing.assert_array_less(error[at], 1e-4 * hard.step_m[at] + 0.05)
    aligned = (normal.T * hard.normal).sum(-1)
    assert np.mean(aligned[at] > np.cos(np.radians(0.05))) >= 0.98


def test_the_first_surface_lies_within_a_step_of_the_crossing(hard):
    """Geometry: as above. Expectation: where a 16 times finer march first meets cloud.

    Tolerance: one step; rays whose coarse march jumps over a thin cloud are left out.
    """
    _, distance, _ = _marched(1e-5)
    late = (distance - hard.crossing_m)[hard.depth_m > 0] / hard.step_m[
        hard.depth_m > 0
    ]
    assert np.mean(np.abs(late) <= 1) > 0.9
    assert late.min() > -0.6


def test_the_soft_level_set_converges_to_the_hard_one(hard):
    """Geometry: as above. Expectation: the error of the way through cloud falls with
    the smoothing, at least in proportion.

    Source: a symmetric step of width s misjudges only samples within s of the
    threshold. Tolerance: 1.5 on each factor of ten.
    """
    errors = [
        np.abs(_marched(s)[0] - hard.depth_m).mean() / hard.depth_m.mean()
        for s in (0.1, 0.01, 0.001)
    ]
    assert errors[0] < 0.2
    assert errors[1] < errors[0] / 6.5
    assert errors[2] < errors[1] / 6.5


# Sub-pixel structure -----------------------------------------------------------------

SIDE, PARTS, PIXEL_RAD = 16, 8, 5.6e-5  # 2 km below geostationary orbit


def _pixels(parts: int) -> Rays:
    """A square of pixels around the sub-satellite point, each in parts², row by row."""
    count = SIDE * parts
    angle = ((np.arange(count) + 0.5) / parts - SIDE / 2) * PIXEL_RAD
    y, x = (c.ravel() for c in np.meshgrid(angle, angle, indexing="ij"))
    target = np.stack([0 * x, 3.6e7 * np.tan(x), 3.6e7 * np.tan(y)], axis=-1)
    target[:, 0] = 42164160.0 - 3.6e7
    return rays_to(np.array([42164160.0, 0, 0]), target, PIXEL_RAD)


def _reflectance(seed, rays, footprint=0.0, nodes=1, share=0.0):
    cloud = fractal_cloud(threshold=0.8, smoothing=1e-3, nodes=nodes)
    latent = dataclasses.replace(cloud.latent, share=jnp.asarray(share, float))
    cloud = dataclasses.replace(cloud, latent=latent)
    scene = make_scene(
        [layer(cloud, emissive=0, extinction_per_m=0.004)], reflective_bands(1)
    )
    view = navigate(scene, rays, sun(40.0, 0.0, 0.0))
    seeded = dataclasses.replace(cloud, seed=seed)
    # The seed is static: only the textures take it, so that one compilation serves all.
    textures = (seeded.make_textures(footprint, 32),)
    background = make_background(scene, len(rays), reflected=0.0)
    seen = render(scene, view, textures, background, tile=len(rays))
    assert scene.reflective is not None
    assert seen.reflective is not None
    return np.asarray(scene.reflective.reflectance(seen.reflective)[0], float)


def _pixel_means(values):
    return values.reshape(SIDE, PARTS, SIDE, PARTS).mean((1, 3)).ravel()


def _errors(found, truth):
    """Mean, pixel by pixel, and between the distributions (W1)."""
    return np.array(
        [
            abs(found.mean() - truth.mean()),
            np.sqrt(((found - truth) ** 2).mean()),
            np.abs(np.sort(found) - np.sort(truth)).mean(),
        ]
    )


@ft.cache
def _hard_rays(seed):
    """What many hard rays per pixel see, and one alone."""
    return _pixel_means(_reflectance(seed, _pixels(PARTS))), _reflectance(
        seed, _pixels(1)
    )


@pytest.mark.parametrize(
    ("share", "pixel", "distribution", "bias"),
    [(0.8, 1.3, 1.4, 0.3), (0.95, 1.5, 1.8, 0.15)],
    ids=["default share", "share 0.95"],
)
def test_averaged_textures_and_latent_nodes_beat_one_hard_ray_per_pixel(
    share, pixel, distribution, bias
):
    """Geometry: 16² pixels of 2 km from above, textures of 40 and 17 km period.

    Expectation: closer to the mean of 64 hard rays per pixel than one hard ray through
    its middle, pixel by pixel and in the distribution. Source: the sub-pixel variance
    that averaging removes is carried by the latent. The mean of many hard rays has no
    bias; the soft one is too bright, the more so the less of the latent is common to
    the whole ray. Measured gains by pixel and by distribution, and bias of the mean:
    1.50, 1.67, 20 % at a share of 0.8; 1.71, 2.14, 10 % at 0.95. Tolerance: a little
    less.
    """
    one = _pixels(1)
    footprint = float(np.median(one.footprint_m()))
    errors, mean = np.zeros((2, 3)), 0.0
    for seed in (3, 10):
        truth, hard = _hard_rays(seed)
        soft = _reflectance(seed, one, footprint, 3, share)
        errors += np.array([_errors(x, truth) for x in (hard, soft)])
        mean += truth.mean()
    gain = errors[0] / errors[1]
    assert gain[1] > pixel, gain
    assert gain[2] > distribution, gain
    assert errors[1, 0] < bias * mean, errors / mean
