"""Batches of rays and of scenes, and what a view is."""

import pickle

import jax
import jax.numpy as jnp
import numpy as np

from cloudjax import radiances
from cloudjax.geometry.footprint import kinds
from tests.unit.source_contract.contract import (
    EACH_SOURCE,
    NEAR,
    assert_close,
    assert_equal,
    mixed,
    moved_by,
    parameters_of,
    scene_of,
    view_of,
)


@EACH_SOURCE
def test_scenes_at_once_and_rays_one_by_one_are_the_batch_of_each_scene(source):
    scene = scene_of(source)
    names, view = parameters_of(scene), view_of(scene)
    assert view.is_of_one_ray is False
    x = np.random.default_rng(1).normal(size=(8, len(names)))
    scenes = [moved_by(scene, names, one) for one in x]
    stacked = jax.tree.map(lambda *leaves: jnp.stack(leaves), *scenes)
    of_rays = jax.vmap(radiances, in_axes=(None, 0), out_axes=1)
    found = jax.jit(jax.vmap(of_rays, in_axes=(0, None)))(stacked, view)
    each = [radiances(one, view) for one in scenes]
    expected = jax.tree.map(lambda *leaves: jnp.stack(leaves), *each)
    assert_close(found, expected, rtol=2e-5)
    assert np.ptp(np.asarray(found.reflective), axis=0).min() > 0.01


@EACH_SOURCE
def test_some_of_a_view_is_the_view_of_some(source):
    scene = scene_of(source)
    assert len(np.unique(kinds(NEAR, scene.shell), axis=0)) == 1
    view, some = view_of(scene), np.array([7, 2, 3])
    assert_close(view[some], view_of(scene, NEAR[some]), rtol=1e-5, atol=1e-5)


@EACH_SOURCE
def test_a_view_is_of_rays_and_of_no_parameter(source):
    scene = scene_of(source)
    rays, _ = mixed(5.6e-5)
    view = view_of(scene, rays)
    assert len(view) == len(rays)
    assert {leaf.shape[0] for leaf in jax.tree.leaves(view)} == {len(rays)}
    back = pickle.loads(pickle.dumps(view))
    assert_equal(back, view)
    assert_equal(radiances(scene, back), radiances(scene, view))
    names = parameters_of(scene)
    changed = moved_by(scene, names, np.full(len(names), 3.0))
    assert_equal(view_of(changed, rays), view)
