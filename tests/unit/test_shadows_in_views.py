"""Shadows reach every way in which a scene is rendered."""

import dataclasses

import numpy as np
import pytest

from cloudjax import Shadows, look, prepare, radiances, render
from tests.helpers import (
    fractal_cloud,
    geostationary_rays,
    layer,
    make_scene,
    reflective_bands,
    sun,
)


RAYS, SUN = geostationary_rays(24), sun(60.0)
WAYS = {
    "of rays": lambda scene: render(scene, RAYS, SUN).radiances,
    "of a view": lambda scene: render(scene, _view(scene)).radiances,
    "prepared": lambda scene: render(scene, prepare(scene, RAYS, SUN)).radiances,
    "pure": lambda scene: radiances(scene, _view(scene)),
}


def _view(scene):
    return look(scene, RAYS, SUN)


@pytest.fixture(scope="module")
def scenes():
    """Without shadows and with them."""
    cloud = layer(fractal_cloud(nodes=2), extinction_per_m=0.01, steps=4)
    plain = make_scene([cloud], reflective_bands(1))
    return plain, dataclasses.replace(plain, shadows=Shadows(2))


@pytest.fixture(scope="module")
def expected(scenes):
    return [np.asarray(WAYS["of rays"](scene).reflective) for scene in scenes]


def test_shadows_are_seen(expected):
    plain, shaded = expected
    assert (np.abs(shaded / plain - 1) > 0.01).sum() > len(RAYS) / 4


@pytest.mark.parametrize("way", WAYS)
def test_every_render_has_them(scenes, expected, way):
    for scene, wanted in zip(scenes, expected, strict=True):
        found = np.asarray(WAYS[way](scene).reflective)
        np.testing.assert_allclose(found, wanted, rtol=2e-5)
