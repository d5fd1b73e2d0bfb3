"""Derivatives by parameters, and views that follow them."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import GriddedCloud, radiances
from cloudjax.image.render import prepare, render
from tests.unit.source_contract.contract import (
    EACH_LIGHT,
    EACH_SOURCE,
    LIGHTS,
    NEAR,
    SOURCES,
    SUN,
    TILE,
    assert_close,
    assert_equal,
    moved_by,
    parameters_of,
    scene_of,
    summed,
    view_of,
)


@EACH_SOURCE
@EACH_LIGHT
def test_derivatives_by_every_parameter_are_those_of_the_public_path(source, light):
    """Differences look anew at each changed scene, so that nothing can hide in a view.

    In double precision. Reverse mode differentiates what forward mode does. What a
    light does not depend on is exactly 0.
    """
    lit, silent = light
    with jax.enable_x64(True):
        scene = scene_of(source, lit)
        names = parameters_of(scene)

        def seen(x, view):
            return summed(radiances(moved_by(scene, names, x), view))

        @jax.jit
        def seen_and_slopes(x, view):
            value, back = jax.vjp(lambda x: seen(x, view), x)
            return value, jax.vmap(back)(jnp.eye(len(value)))[0]

        def afresh(x):
            view = view_of(moved_by(scene, names, x))
            return np.asarray(seen_and_slopes(jnp.asarray(x), view)[0])

        zero, h = jnp.zeros(len(names)), 1e-4
        slopes = np.asarray(seen_and_slopes(zero, view_of(scene))[1])
        ends = [afresh(h * e) - afresh(-h * e) for e in np.eye(len(names))]
    differences = np.stack(ends, axis=-1) / (2 * h)
    np.testing.assert_allclose(slopes, differences, rtol=1e-4, atol=1e-7)
    most = dict(zip(names, np.abs(slopes).max(0), strict=True))
    assert {name for name, slope in most.items() if slope == 0} == set(silent)
    assert min(slope for name, slope in most.items() if name not in silent) > 1e-7


@EACH_SOURCE
def test_a_view_and_an_image_follow_every_change_of_parameters(source):
    """What was seen once shows the changed scene, with its shadows."""
    scene = scene_of(source)
    names, view = parameters_of(scene), view_of(scene)
    prepared, before = prepare(scene, NEAR, SUN, tile=TILE), radiances(scene, view)
    _, silent = LIGHTS["paper with shadows"]
    for name, x in zip(names, 3 * np.eye(len(names)), strict=True):
        changed = moved_by(scene, names, x)
        found = radiances(changed, view)
        assert_equal(found, radiances(changed, view_of(changed)))
        image = render(changed, prepared).radiances
        assert_close(image, found)
        assert_close(render(changed, NEAR, SUN, tile=TILE).radiances, image, 1e-6)
        moved = max(
            np.abs(a - b).max()
            for a, b in zip(
                jax.tree.leaves(found), jax.tree.leaves(before), strict=True
            )
        )
        assert (moved == 0) == (name in silent), name


@pytest.mark.parametrize("name", ["gridded", "periodic"])
def test_a_grid_that_is_emptied_shows_the_clear_sky(name):
    scene = dataclasses.replace(scene_of(SOURCES[name]), shadows=None)
    scene = dataclasses.replace(scene, layers=scene.layers[:1])
    view, prepared = view_of(scene), prepare(scene, NEAR, SUN, tile=TILE)
    cloud = scene.layers[0].cloud
    assert isinstance(cloud, GriddedCloud)
    cloud = dataclasses.replace(cloud, density=0 * cloud.density)
    own = dataclasses.replace(scene.layers[0], cloud=cloud)
    empty = dataclasses.replace(scene, layers=(own,))
    sky = dataclasses.replace(scene, layers=())
    clear = radiances(sky, view_of(sky))
    assert_close(radiances(empty, view), clear, rtol=1e-6)
    assert_close(render(empty, prepared).radiances, clear, rtol=1e-6)
    full = jax.tree.leaves(radiances(scene, view))
    assert np.abs(full[0] - jax.tree.leaves(clear)[0]).max() > 10
