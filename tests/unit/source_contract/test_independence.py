"""An image is what each of its rays sees by itself."""

import jax
import numpy as np
import pytest

from cloudjax import radiances
from cloudjax.geometry.footprint import kinds
from cloudjax.image.render import render
from tests.unit.source_contract.contract import (
    EACH_SOURCE,
    SUN,
    TILE,
    assert_close,
    mixed,
    scene_of,
    view_of,
)


@EACH_SOURCE
@pytest.mark.parametrize(
    "pixel_rad", [5.6e-5, pytest.param(3e-6, marks=pytest.mark.slow)]
)
def test_an_image_is_what_its_rays_see_whatever_else_is_in_view(source, pixel_rad):
    scene = scene_of(source)
    rays, misses = mixed(pixel_rad)
    assert len(np.unique(kinds(rays, scene.shell)[:, 2:], axis=0)) >= 3
    together = radiances(scene, view_of(scene, rays))
    image = render(scene, rays, SUN, tile=TILE).radiances
    assert_close(image, together, rtol=1e-4, atol=1e-3)
    for ray in (1, 10):
        alone = render(scene, rays[[ray]], SUN, tile=TILE).radiances
        assert_close(alone, together[np.array([ray])], rtol=1e-4, atol=1e-3)
    alone = radiances(scene, view_of(scene, rays[[1]]))
    assert_close(alone, together[np.array([1])], rtol=1e-4, atol=1e-3)
    for seen in jax.tree.leaves(together):
        np.testing.assert_array_equal(seen[:, misses], 0)
