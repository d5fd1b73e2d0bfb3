"""What every source of cloud promises (`clouds/source.py`), for all of them alike.

A new source is one more entry of `SOURCES`.
"""

import dataclasses
import functools as ft
import pickle
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import (
    AbstractCloudSource,
    EmittingSlabs,
    FractalCloud,
    GriddedCloud,
    PlaneParallel,
    Rays,
    Scene,
    Shadows,
    Shell,
    Slabs,
    look,
    radiances,
)
from cloudjax.geometry.footprint import kinds
from cloudjax.image.render import prepare, render
from tests.helpers import (
    GEOSTATIONARY_M,
    FunctionMask,
    PlacesGround,
    TurnedAir,
    emissive_bands,
    fractal_cloud,
    ground_points,
    layer,
    limb_rays,
    make_scene,
    rays_to,
    reflective_bands,
    sun,
)


N, STEPS, RAYS = 16, 5, 12
SUN = sun(50.0)
NEAR = rays_to(GEOSTATIONARY_M, ground_points(RAYS, 20.0, 10.0, 0.08))


def _tilted(latitude_deg, longitude_deg):
    return (latitude_deg - 20) * 4


def _fractal() -> FractalCloud:
    return dataclasses.replace(
        fractal_cloud(nodes=3, smoothing=0.3),
        mask=FunctionMask(_tilted),
        displacements=(TurnedAir.by(2.0), None),
    )


def _gridded(periodic: bool) -> GriddedCloud:
    """24 km wide, more than the rays are apart, with cells as wide as pixels."""
    values = np.random.default_rng(0).uniform(0.1, 0.9, (8, 8, 3))
    return GriddedCloud(
        density=jnp.asarray(values, float),
        shell=Shell(1000.0, 2200.0),
        corner_deg=(19.9, 9.9),
        spacing_m=(3000.0, 3000.0),
        periodic=periodic,
    )


SOURCES: dict[str, Callable[[], AbstractCloudSource]] = {
    "fractal": _fractal,
    "gridded": ft.partial(_gridded, periodic=False),
    "periodic": ft.partial(_gridded, periodic=True),
}
# What depends on places and is read with them. Not parameters.
READ_WITH_PLACES = ("mask", "displacements")


def _paper_with_shadows(scene: Scene) -> Scene:
    return dataclasses.replace(scene, shadows=Shadows(2, points=3))


def _physical(scene: Scene) -> Scene:
    slabs = PlaneParallel.load()
    return dataclasses.replace(
        scene, reflection=Slabs(slabs), emission=EmittingSlabs(slabs)
    )


# What light does not depend on, and why.
LIGHTS = {
    "paper with shadows": (
        _paper_with_shadows,
        dict.fromkeys(
            (".thermal_co_albedo", ".thermal_asymmetry"),
            "cloud is taken for an absorber where the scene has no emission",
        ),
    ),
    "physical": (_physical, {}),
}
EACH_SOURCE = pytest.mark.parametrize("source", SOURCES.values(), ids=SOURCES)
EACH_LIGHT = pytest.mark.parametrize("light", LIGHTS.values(), ids=LIGHTS)


def _scene(source, light=_paper_with_shadows) -> Scene:
    """The source below a fractal cloud, over a ground that differs everywhere."""
    both = {
        "reflective": 2,
        "steps": STEPS,
        "asymmetry": [0.85, 0.8],
        "relative_extinction": [1.0, 1.1],
        "co_albedo": [0.01, 0.05],
        "thermal_co_albedo": [0.4],
        "thermal_asymmetry": [0.9],
    }
    above = fractal_cloud(Shell(5e3, 7e3), base_m=5300.0, top_m=6800.0)
    return light(
        make_scene(
            [
                layer(source(), name="tested", **both),
                layer(above, extinction_per_m=3e-4, name="above", **both),
            ],
            reflective_bands(1, 5),
            emissive_bands(13),
            ground=PlacesGround(),
        )
    )


def _parameters(scene: Scene) -> list[str]:
    """Names of all arrays of the tested layer that are parameters."""
    named, _ = jax.tree_util.tree_flatten_with_path(scene.layers[0])
    return [
        jax.tree_util.keystr(path)
        for path, leaf in named
        if jnp.issubdtype(leaf.dtype, jnp.floating)
        and not any(
            f".{name}" in jax.tree_util.keystr(path) for name in READ_WITH_PLACES
        )
    ]


def _changed(scene: Scene, names: list[str], x) -> Scene:
    """Each parameter moved by tenths of its values, each entry by a part of its own."""
    named, tree = jax.tree_util.tree_flatten_with_path(scene.layers[0])
    moved = []
    for path, leaf in named:
        name = jax.tree_util.keystr(path)
        if name in names:
            rng = np.random.default_rng(len(name))
            part = jnp.asarray(0.1 * rng.uniform(0.5, 1, leaf.shape), leaf.dtype)
            leaf = leaf * (1 + x[names.index(name)] * part)
        moved.append(leaf)
    own = jax.tree.unflatten(tree, moved)
    return dataclasses.replace(scene, layers=(own, *scene.layers[1:]))


def _look(scene: Scene, rays: Rays = NEAR):
    return look(scene, rays, SUN, resolution=N)


def _assert_close(one, other, rtol=1e-5, atol=0.0):
    assert jax.tree.structure(one) == jax.tree.structure(other)
    for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        np.testing.assert_allclose(a, b, rtol=rtol, atol=atol)


def _assert_equal(one, other):
    _assert_close(one, other, rtol=0)


def _summed(seen):
    """Means and mean squares of each band, of about the size of one."""
    values = jnp.concatenate([seen.reflective, seen.emissive]) / 100
    return jnp.concatenate([values.mean(1), (values**2).mean(1)])


# (i) derivatives


@EACH_SOURCE
@EACH_LIGHT
def test_derivatives_by_every_parameter_are_those_of_the_public_path(source, light):
    """Differences look anew at each changed scene, so that nothing can hide in a view.

    In double precision. What a light does not depend on is exactly 0.
    """
    lit, silent = light
    with jax.enable_x64(True):
        scene = _scene(source, lit)
        names = _parameters(scene)
        view, zero = _look(scene), jnp.zeros(len(names))

        def seen(x):
            return _summed(radiances(_changed(scene, names, x), view))

        def afresh(x):
            changed = _changed(scene, names, x)
            return np.asarray(_summed(radiances(changed, _look(changed))))

        forward = np.asarray(jax.jit(jax.jacfwd(seen))(zero))
        reverse = np.asarray(jax.jit(jax.jacrev(seen))(zero))
        h = 1e-4
        ends = [afresh(h * e) - afresh(-h * e) for e in np.eye(len(names))]
    np.testing.assert_allclose(forward, reverse, rtol=1e-8, atol=1e-12)
    differences = np.stack(ends, axis=-1) / (2 * h)
    np.testing.assert_allclose(forward, differences, rtol=1e-4, atol=1e-7)
    most = dict(zip(names, np.abs(forward).max(0), strict=True))
    assert {name for name, slope in most.items() if slope == 0} == set(silent)
    assert min(slope for name, slope in most.items() if name not in silent) > 1e-7


# (ii) views follow the parameters


@EACH_SOURCE
def test_a_view_and_an_image_follow_every_change_of_parameters(source):
    """What was seen once shows the changed scene, with its shadows."""
    scene = _scene(source)
    names, view = _parameters(scene), _look(scene)
    prepared, before = prepare(scene, NEAR, SUN, resolution=N), radiances(scene, view)
    _, silent = LIGHTS["paper with shadows"]
    for name, x in zip(names, 3 * np.eye(len(names)), strict=True):
        changed = _changed(scene, names, x)
        found = radiances(changed, view)
        _assert_equal(found, radiances(changed, _look(changed)))
        image = render(changed, prepared).radiances
        _assert_close(image, found)
        _assert_close(render(changed, NEAR, SUN, resolution=N).radiances, image, 1e-6)
        moved = max(
            np.abs(a - b).max()
            for a, b in zip(
                jax.tree.leaves(found), jax.tree.leaves(before), strict=True
            )
        )
        assert (moved == 0) == (name in silent), name


@pytest.mark.parametrize("name", ["gridded", "periodic"])
def test_a_grid_that_is_emptied_shows_the_clear_sky(name):
    scene = dataclasses.replace(_scene(SOURCES[name]), shadows=None)
    scene = dataclasses.replace(scene, layers=scene.layers[:1])
    view, prepared = _look(scene), prepare(scene, NEAR, SUN, resolution=N)
    cloud = scene.layers[0].cloud
    assert isinstance(cloud, GriddedCloud)
    cloud = dataclasses.replace(cloud, density=0 * cloud.density)
    own = dataclasses.replace(scene.layers[0], cloud=cloud)
    empty = dataclasses.replace(scene, layers=(own,))
    sky = dataclasses.replace(scene, layers=())
    clear = radiances(sky, _look(sky))
    _assert_close(radiances(empty, view), clear, rtol=1e-6)
    _assert_close(render(empty, prepared).radiances, clear, rtol=1e-6)
    full = jax.tree.leaves(radiances(scene, view))
    assert np.abs(full[0] - jax.tree.leaves(clear)[0]).max() > 10


# (iii) batches


@EACH_SOURCE
def test_rays_one_by_one_are_the_batch(source):
    scene = _scene(source)
    view = _look(scene)
    assert view.is_of_one_ray is False
    alone = jax.jit(jax.vmap(radiances, in_axes=(None, 0)))(scene, view)
    together = radiances(scene, view)
    _assert_close(jax.tree.map(jnp.transpose, alone), together, rtol=2e-5)


@EACH_SOURCE
def test_eight_scenes_at_once_are_eight_scenes(source):
    scene = _scene(source)
    names, view = _parameters(scene), _look(scene)
    x = np.random.default_rng(1).normal(size=(8, len(names)))
    scenes = [_changed(scene, names, one) for one in x]
    stacked = jax.tree.map(lambda *leaves: jnp.stack(leaves), *scenes)
    found = jax.jit(jax.vmap(radiances, in_axes=(0, None)))(stacked, view)
    each = [radiances(one, view) for one in scenes]
    expected = jax.tree.map(lambda *leaves: jnp.stack(leaves), *each)
    _assert_close(found, expected, rtol=2e-5)
    assert np.ptp(np.asarray(found.reflective), axis=0).min() > 0.01


@EACH_SOURCE
def test_some_of_a_view_is_the_view_of_some(source):
    scene = _scene(source)
    assert len(np.unique(kinds(NEAR, scene.shell), axis=0)) == 1
    view, some = _look(scene), np.array([7, 2, 3])
    _assert_close(view[some], _look(scene, NEAR[some]), rtol=1e-5, atol=1e-5)


# (iv) independence


def _mixed(pixel_rad: float) -> tuple[Rays, np.ndarray]:
    """Short ways, ways along the limb and rays that miss; and which ones miss."""
    limb, off = limb_rays(500.0, 2e3, 6e3), limb_rays(1e5, 3e6)
    beside = rays_to(GEOSTATIONARY_M, np.array([[0.0, 6.4e6, 1e6], [0.0, 6.3e6, 0.0]]))
    parts = (limb, NEAR[:4], off, beside, NEAR[4:7])
    misses = np.zeros(14, bool)
    misses[7:9] = True
    return (
        Rays(
            np.concatenate([part.origin_m for part in parts]),
            np.concatenate([part.direction for part in parts]),
            pixel_rad,
        ),
        misses,
    )


@EACH_SOURCE
@pytest.mark.parametrize("pixel_rad", [5.6e-5, 3e-6])
def test_an_image_is_what_its_rays_see_whatever_else_is_in_view(source, pixel_rad):
    scene = _scene(source)
    rays, misses = _mixed(pixel_rad)
    assert len(np.unique(kinds(rays, scene.shell)[:, 5:], axis=0)) >= 3
    together = radiances(scene, _look(scene, rays))
    for tile in (None, 32):
        image = render(scene, rays, SUN, resolution=N, tile=tile).radiances
        _assert_close(image, together, rtol=1e-4, atol=1e-3)
    for ray in (1, 4, 9, 12):
        alone = radiances(scene, _look(scene, rays[[ray]]))
        _assert_close(alone, together[np.array([ray])], rtol=1e-4, atol=1e-3)
    for seen in jax.tree.leaves(together):
        np.testing.assert_array_equal(seen[:, misses], 0)


# (v) what a view is


@EACH_SOURCE
def test_a_view_is_of_rays_and_of_no_parameter(source):
    scene = _scene(source)
    rays, _ = _mixed(5.6e-5)
    view = _look(scene, rays)
    assert len(view) == len(rays)
    assert {leaf.shape[0] for leaf in jax.tree.leaves(view)} == {len(rays)}
    back = pickle.loads(pickle.dumps(view))
    _assert_equal(back, view)
    _assert_equal(radiances(scene, back), radiances(scene, view))
    names = _parameters(scene)
    changed = _changed(scene, names, np.full(len(names), 3.0))
    _assert_equal(_look(changed, rays), view)
