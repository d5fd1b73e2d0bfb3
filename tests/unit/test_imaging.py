"""Whole images: the same whatever the tiles, and finite everywhere."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array, Float

from cloudjax import AbstractMask, Rays, look, radiances
from cloudjax.geometry.footprint import kind_of, kinds
from cloudjax.image.render import prepare, render
from cloudjax.march.view import lay, make_textures, sample
from tests.helpers import (
    GEOSTATIONARY_M,
    PlacesGround,
    emissive_bands,
    fractal_cloud,
    geostationary_rays,
    layer,
    limb_rays,
    make_scene,
    rays_to,
    reflective_bands,
    sun,
    under_weather,
)


BARE = make_scene(
    [layer(fractal_cloud(nodes=3), steps=8)],
    reflective_bands(1),
    emissive_bands(13),
    ground=PlacesGround(),
)
SUN = sun(40.0)
SCENE = under_weather(BARE, [lambda latitude, longitude: (latitude - 20) / 4])


def _wide(count: int = 700) -> Rays:
    """Rays all over the disc and beside it, of many kinds."""
    rng = np.random.default_rng(4)
    across = rng.uniform(-0.16, 0.16, (2, count)) * 3.6e7
    target = np.stack([0 * across[0] + 6.2e6, *across], axis=-1)
    return rays_to(GEOSTATIONARY_M, target)


def _render(sight, **options):
    return render(SCENE, sight, SUN, **options)


def _leaves(image):
    return jax.tree.leaves((image.radiances, image.clouds))


@pytest.fixture(scope="module")
def image():
    return _render(_wide(), with_products=True)


def test_every_ray_is_rendered_and_finite(image):
    rays = _wide()
    assert image.radiances.reflective.shape == (1, len(rays))
    missing = ~rays.ground()[1]
    assert 50 < missing.sum() < 600
    for field in (*jax.tree.leaves(image.radiances), image.clouds.fraction):
        assert np.isfinite(field).all()
    assert np.isnan(image.clouds.top_height_m).any()
    assert np.all(np.isfinite(image.clouds.top_height_m[image.clouds.fraction > 0.5]))


def test_rays_that_miss_all_air_see_nothing(image):
    """Beside the Earth there is no ground, whatever a ground would say there."""
    target = _wide()
    clear = image.clouds.optical_depth == 0
    off = np.linalg.norm(np.cross(GEOSTATIONARY_M, target.direction), axis=-1) > 6.5e6
    assert off.sum() > 50
    assert clear[off].all()
    for seen in jax.tree.leaves(image.radiances):
        np.testing.assert_array_equal(seen[:, off], 0)
        assert seen[:, target.ground()[1]].min() > 0


@pytest.mark.parametrize("tile", [300, 97])
def test_the_image_does_not_depend_on_the_tile(image, tile):
    """Bit for bit where the compiled sizes agree; to rounding where XLA differs."""
    other = _render(_wide(), with_products=True, tile=tile)
    for a, b in zip(_leaves(image), _leaves(other), strict=True):
        np.testing.assert_allclose(a, b, rtol=2e-5, atol=2e-5)


def test_a_function_of_the_pixels_gives_the_same_image(image):
    rays = _wide()
    other = _render(lambda index: rays[index], rays=len(rays), with_products=True)
    for a, b in zip(_leaves(image), _leaves(other), strict=True):
        np.testing.assert_array_equal(a, b)


def test_a_function_without_a_number_is_refused():
    with pytest.raises(ValueError, match="Give the number of rays"):
        _render(lambda index: _wide()[index])


def test_a_prepared_view_gives_the_same_image_again_and_again(image):
    prepared = prepare(SCENE, _wide(), SUN)
    for _ in range(2):
        again = render(SCENE, prepared, with_products=True)
        for a, b in zip(_leaves(image), _leaves(again), strict=True):
            np.testing.assert_array_equal(a, b)


def test_a_prepared_view_shows_other_parameters_of_the_clouds():
    """Also where the first scene had no cloud at all."""
    rays = _wide()

    def threshold(value):
        where = lambda s: s.layers[0].cloud.function.threshold  # noqa: E731
        return eqx.tree_at(where, SCENE, jnp.asarray(value))

    prepared = prepare(threshold(60.0), rays, SUN)
    clear = render(threshold(60.0), prepared, with_products=True)
    assert clear.clouds is not None
    np.testing.assert_array_equal(clear.clouds.optical_depth, 0)
    behind = render(dataclasses.replace(SCENE, layers=()), rays, SUN)
    for seen, ground in zip(
        jax.tree.leaves(clear.radiances), jax.tree.leaves(behind.radiances), strict=True
    ):
        np.testing.assert_array_equal(seen, ground)
    cloudy = render(threshold(-1.0), prepared)
    other = render(threshold(-1.0), rays, SUN)
    np.testing.assert_array_equal(cloudy.radiances.emissive, other.radiances.emissive)


def test_a_prepared_view_may_be_marched_in_fewer_steps():
    """As if sampled in as many, but for rays whose noise is read at each step."""
    fewer = eqx.tree_at(
        lambda s: s.layers, SCENE, tuple(_in_steps(la, 4) for la in SCENE.layers)
    )
    rays = _wide()
    prepared = prepare(SCENE, rays, SUN)
    found = render(fewer, prepared).radiances.reflective
    expected = render(fewer, rays, SUN).radiances.reflective
    assert found is not None
    assert expected is not None
    assert np.abs(found - expected).mean() < 0.05 * np.std(expected)


def _in_steps(layer, steps: int):
    return dataclasses.replace(layer, steps=steps)


def test_rays_left_out_would_have_shown_no_cloud(image, monkeypatch):
    """Marched all the same, no ray differs by more than a thousandth of the contrast.

    The chance that is let go is 5e-4, and half of the cloud up to 1e-3.
    """
    monkeypatch.setattr("cloudjax.march.radiances.LEAST_LIKELIHOOD", 1e-30)
    # Of another name, so that it is compiled for itself.
    named = tuple(dataclasses.replace(la, name="marched") for la in SCENE.layers)
    scene = dataclasses.replace(SCENE, layers=named)
    every = render(scene, _wide(), SUN)
    for a, b in zip(
        jax.tree.leaves(image.radiances), jax.tree.leaves(every.radiances), strict=True
    ):
        assert np.abs(a.mean() - b.mean()) < 1e-3 * b.std()


def test_without_products_there_are_none():
    assert _render(geostationary_rays(5)).clouds is None


def test_a_view_is_in_the_order_of_the_rays(monkeypatch):
    """Each ray's own kind sampled by hand, for one ray of every kind.

    What is held in the view may be held at more points; what is seen is the same.
    """
    monkeypatch.setattr("cloudjax.march.view._AT_ONCE", 64)
    rays = geostationary_rays(200, 40.0)
    found = radiances(SCENE, look(SCENE, rays, SUN))
    rows = kinds(rays, SCENE.layers[0].cloud.shell)
    _, first = np.unique(rows, axis=0, return_index=True)
    assert len(first) > 2
    for i in first[:6]:
        kind = kind_of(rows[i])
        ways = lay(SCENE, rays[[i]], SUN, kind.sampling, twice=kind.twice)
        view = sample(SCENE, ways, make_textures(SCENE))
        alone = radiances(SCENE, view)
        for a, b in zip(jax.tree.leaves(alone), jax.tree.leaves(found), strict=True):
            np.testing.assert_allclose(a[:, 0], b[:, i], rtol=1e-4)


class Beyond(AbstractMask):
    """Cloud on one side of a meridian only, east of it where `side` is positive."""

    meridian_deg: Float[Array, ""]
    side: Float[Array, ""]

    def __call__(self, latitude_deg, longitude_deg):
        ahead = (longitude_deg - self.meridian_deg) * self.side
        return 80.0 * (ahead > 0) - 40.0


def test_a_ray_that_grazes_gets_cloud_from_the_far_side():
    """A mask that leaves cloud only behind the closest approach, at 90 E."""
    rays = limb_rays(*np.linspace(100.0, 400.0, 5))
    assert np.all(kinds(rays, SCENE.layers[0].cloud.shell)[:, 3] == 1)

    def depth(meridian_deg, side):
        mask = Beyond(jnp.asarray(meridian_deg), jnp.asarray(side))
        scene = under_weather(BARE, [mask])
        seen = render(scene, rays, SUN, with_products=True)
        assert seen.clouds is not None
        return seen.clouds.optical_depth

    near, far, both = depth(90.0, -1.0), depth(90.0, 1.0), depth(360.0, -1.0)
    assert far.min() > 0.05
    assert near.min() > 0.05
    np.testing.assert_allclose(near + far, both, rtol=1e-3)
