"""Four devices, and two processes, see what one device sees."""

import itertools

import jax
import numpy as np
import pytest

from cloudjax import look, radiances
from cloudjax.image import hosts
from cloudjax.image.devices import spread
from cloudjax.image.render import render
from tests.helpers import (
    emissive_bands,
    fractal_cloud,
    geostationary_rays,
    layer,
    make_scene,
    reflective_bands,
    sun,
)
from tests.other_processes import found_by


# Two processes have 150 and 149.
RAYS = 299


def image() -> list[np.ndarray]:
    """An image in several tiles, the last one small."""
    scene, rays, light = _scene()
    seen = render(scene, rays, light, tile=90, with_products=True)
    return [np.asarray(x) for x in jax.tree.leaves((seen.radiances, seen.clouds))]


def image_and_view() -> list[np.ndarray]:
    """The image, and radiances of a view of rays that four devices divide."""
    scene, rays, light = _scene()
    view = spread(look(scene, rays[np.arange(RAYS + 1) % RAYS], light))
    seen = jax.tree.leaves(radiances(scene, view))
    return [*image(), *(np.asarray(leaf)[..., :RAYS] for leaf in seen)]


def _scene():
    scene = make_scene(
        [layer(fractal_cloud(nodes=3), steps=4)],
        reflective_bands(1),
        emissive_bands(13),
    )
    return scene, geostationary_rays(RAYS), sun(40.0)


@pytest.fixture(scope="module")
def expected() -> list[np.ndarray]:
    return image()


def _require_equal(found, expected) -> None:
    assert len(found) == len(expected)
    for one, other in zip(found, expected, strict=True):
        assert one.shape[-1] == RAYS
        np.testing.assert_allclose(one, other, rtol=2e-5, atol=1e-6)


def test_four_devices_see_what_one_sees(expected, tmp_path):
    """Tolerance: rounding of float32."""
    (found,) = found_by(image_and_view, tmp_path, devices=4)
    _require_equal(found, [*expected, *expected[:2]])


def test_two_processes_see_what_one_sees(expected, tmp_path):
    """Each renders half, and has the whole. Tolerance: as above."""
    for found in found_by(image, tmp_path, processes=2):
        _require_equal(found, expected)


@pytest.mark.parametrize("rays", [16, 17, 19, 100])
def test_parts_are_all_rays_once(rays, monkeypatch):
    monkeypatch.setattr(jax, "process_count", lambda: 4)
    parts = []
    for number in range(4):
        monkeypatch.setattr(jax, "process_index", lambda number=number: number)
        parts.append(list(hosts.own_part(rays)))
    assert [*itertools.chain(*parts)] == [*range(rays)]
    assert min(map(len, parts)) > 0
    assert list(hosts.own_part(15)) == list(range(15))
