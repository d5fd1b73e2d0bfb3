"""`radiances` and `products` as pure functions, and what is none and says so."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import (
    Air,
    Scene,
    StandardAtmosphere,
    UniformGround,
    look,
    products,
    radiances,
    radiances_and_products,
)
from cloudjax.image.render import prepare, render
from cloudjax.march.radiances import see
from tests.helpers import (
    emissive_bands,
    fractal_cloud,
    geostationary_rays,
    layer,
    make_scene,
    reflective_bands,
    sun,
)


RAYS = geostationary_rays(10)
SUN = sun(40.0)


def _scene(x: Any = (0.0, 0.0), **changes) -> Scene:
    """Moved by tenths of the extinction and of a threshold."""
    cloud = fractal_cloud(threshold=0.2 + 0.1 * x[1], smoothing=0.3)
    own = layer(cloud, extinction_per_m=0.002 * (1 + 0.1 * x[0]), steps=6)
    ground = changes.pop("ground", UniformGround(albedo=0.1))
    bands = reflective_bands(1), emissive_bands(13)
    return make_scene([own], *bands, ground=ground, **changes)


def _look(scene: Scene):
    return look(scene, RAYS, SUN)


def _of_radiances(scene, view):
    seen = radiances(scene, view)
    return jnp.concatenate([seen.reflective, seen.emissive]) / 100


def _of_products(scene, view):
    clouds = products(scene, view)
    return jnp.stack([clouds.fraction, jnp.log1p(clouds.optical_depth)])


@pytest.fixture(params=[_of_radiances, _of_products], ids=["radiances", "products"])
def seen(request):
    return request.param


# Both -------------------------------------------------------------------------------


def test_derivatives_of_all_kinds_agree_with_differences(seen):
    """First ones of both modes, and second ones, in double precision."""
    with jax.enable_x64(True):
        view = _look(_scene())

        def total(x):
            return (seen(_scene(x), view) ** 2).sum()

        x, h = jnp.asarray([0.3, -0.2]), 1e-4
        value, slope = jax.jit(jax.value_and_grad(total))(x)
        run, grad = jax.jit(total), jax.jit(jax.grad(total))
        alone, curvature = grad(x), jax.jit(jax.hessian(total))(x)
        steps = h * jnp.eye(2)
        slopes = jnp.stack([run(x + s) - run(x - s) for s in steps]) / (2 * h)
        curves = jnp.stack([grad(x + s) - grad(x - s) for s in steps]) / (2 * h)
        every = [jax.jit(jac(lambda x: seen(_scene(x), view)))(x)
                 for jac in (jax.jacfwd, jax.jacrev)]  # fmt: skip
        here = np.asarray(seen(_scene(x), view))
    every, curvature = [np.asarray(one) for one in every], np.asarray(curvature)
    np.testing.assert_allclose(value, (here**2).sum(), rtol=1e-12)
    np.testing.assert_allclose(slope, alone, rtol=1e-12)
    np.testing.assert_allclose(slope, slopes, rtol=1e-6)
    np.testing.assert_allclose(curvature, curvature.T, rtol=1e-9)
    np.testing.assert_allclose(curvature, curves, rtol=1e-5)
    np.testing.assert_allclose(every[0], every[1], rtol=1e-9, atol=1e-12)
    chained = (2 * here[..., None] * every[0]).sum((0, 1))
    np.testing.assert_allclose(slope, chained, rtol=1e-9)
    assert np.abs(slope).min() > 1e-4


def test_batches_of_rays_and_of_scenes_are_loops(seen):
    view = _look(_scene())
    together = seen(_scene(), view)

    def one(scene, ray):
        return seen(scene, jax.tree.map(lambda x: x[None], ray))[:, 0]

    alone = jax.vmap(one, in_axes=(None, 0))(_scene(), view)
    np.testing.assert_allclose(alone.T, together, rtol=2e-5, atol=1e-6)
    x = jnp.linspace(-1.0, 1.0, 16).reshape(8, 2)
    batch = jax.vmap(lambda x: seen(_scene(x), view))(x)
    loop = jnp.stack([seen(_scene(one), view) for one in x])
    np.testing.assert_allclose(batch, loop, rtol=2e-5, atol=1e-6)
    assert np.ptp(np.asarray(batch), axis=0).max() > 0.01


def test_gradients_of_a_batch_of_scenes_are_those_of_each(seen):
    view = _look(_scene())
    x = jnp.linspace(-1.0, 1.0, 6).reshape(3, 2)
    slope = jax.grad(lambda x: seen(_scene(x), view).mean())
    batch, loop = jax.jit(jax.vmap(slope))(x), jnp.stack([slope(one) for one in x])
    np.testing.assert_allclose(batch, loop, rtol=1e-4, atol=1e-6)


def test_a_view_of_one_ray_has_no_axis_of_rays():
    view = _look(_scene())
    one = jax.tree.map(lambda x: x[3], view)
    assert one.is_of_one_ray
    seen, whole = radiances(_scene(), one), radiances(_scene(), view)
    for a, b in zip(jax.tree.leaves(seen), jax.tree.leaves(whole), strict=True):
        assert a.shape == b.shape[:1]
        np.testing.assert_allclose(a, b[:, 3], rtol=2e-5)


# One march --------------------------------------------------------------------------


@pytest.fixture
def marches(monkeypatch):
    """Counts what is marched, each time that a program is traced."""
    from cloudjax.march import marched_way

    count, march = [0], marched_way.march

    def counted(*of):
        count[0] += 1
        return march(*of)

    monkeypatch.setattr(marched_way, "march", counted)
    return count


def _named(name: str) -> Scene:
    """A scene of another structure, so that all of it is traced anew."""
    own = dataclasses.replace(_scene().layers[0], name=name)
    return dataclasses.replace(_scene(), layers=(own,))


def test_radiances_and_products_come_from_one_march(marches):
    scene = _named("both")
    view = _look(scene)
    jax.make_jaxpr(see)(scene, view)
    assert marches == [1]
    seen, clouds = radiances_and_products(scene, view)
    assert marches == [2]
    for one, other in ((seen, radiances(scene, view)), (clouds, products(scene, view))):
        for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
            np.testing.assert_allclose(a, b, rtol=2e-6)


def test_an_image_with_products_is_marched_once(marches):
    image = render(_named("image"), RAYS, SUN, with_products=True)
    assert image.clouds is not None
    assert marches == [1]


# What is not pure -------------------------------------------------------------------


IMPURE = {
    "look": lambda scene: look(scene, RAYS, SUN),
    "prepare": lambda scene: prepare(scene, RAYS, SUN),
    "render": lambda scene: render(scene, RAYS, SUN),
}


@pytest.mark.parametrize("name", IMPURE)
@pytest.mark.parametrize("transform", [jax.jit, jax.grad, jax.vmap])
def test_host_functions_refuse_tracers_and_name_the_pure_ones(name, transform):
    x = jnp.zeros((3, 2)) if transform is jax.vmap else jnp.zeros(2)

    def seen(x):
        IMPURE[name](_scene(x))
        return x.sum()

    with pytest.raises(TypeError, match=rf"`{name}` .* `radiances\(scene, view\)`"):
        transform(seen)(x)


def test_rays_without_a_sun_are_refused():
    with pytest.raises(TypeError, match="Rays need a sun"):
        render(_scene(), RAYS)


def test_an_image_of_a_view_is_what_is_seen():
    view = _look(_scene())
    image, seen = render(_scene(), view).radiances, radiances(_scene(), view)
    for a, b in zip(jax.tree.leaves(image), jax.tree.leaves(seen), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-6)


# All parts of a scene are parameters -------------------------------------------------


SURROUNDINGS = ("albedo", "temperature_k", "emissivity", "humidity", "offset_k")


def test_gradients_of_ground_and_air_are_right():
    """By differences that look anew, in double precision, through gases and cloud."""

    def scene(x):
        p = dict(zip(SURROUNDINGS, x, strict=True))
        standard = Air.of_bands((1, 13))
        ground = UniformGround(
            0.2 + 0.02 * p["albedo"],
            290.0 + 3 * p["temperature_k"],
            0.9 + 0.05 * p["emissivity"],
        )
        humid = standard.specific_humidity * (1 + 0.1 * p["humidity"])
        return _scene(
            ground=ground,
            air=dataclasses.replace(standard, specific_humidity=humid),
            temperature=StandardAtmosphere(2 * p["offset_k"]),
        )

    with jax.enable_x64(True):
        zero, h = jnp.zeros(len(SURROUNDINGS)), 1e-4
        view = _look(scene(zero))
        forward, reverse = (
            np.asarray(jax.jit(jac(lambda x: _of_radiances(scene(x), view)))(zero))
            for jac in (jax.jacfwd, jax.jacrev)
        )
        ends = []
        for step in h * jnp.eye(len(zero)):
            both = [scene(step), scene(-step)]
            up, down = (_of_radiances(one, _look(one)) for one in both)
            ends.append(np.asarray(up - down) / (2 * h))
    np.testing.assert_allclose(forward, reverse, rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(forward, np.stack(ends, -1), rtol=1e-5, atol=1e-8)
    assert np.abs(forward).max((0, 1)).min() > 1e-4


def test_rays_see_the_draws_of_the_clouds_that_are_asked():
    """Each what it sees of the scene drawn anew alone; layers and draws all differ."""
    scene = _scene()
    draw = np.arange(len(RAYS)) % 3
    found = np.asarray(radiances(scene, look(scene, RAYS, SUN, draw)).reflective[0])
    alone = np.array(
        [
            np.asarray(radiances(scene, _look(scene.drawn_anew(number))).reflective[0])
            for number in range(3)
        ]
    )
    np.testing.assert_array_equal(found, alone[draw, np.arange(len(RAYS))])
    assert min(np.ptp(alone, axis=0)[alone[0] > alone.min()]) > 0
    own = radiances(scene, _look(scene)).reflective
    np.testing.assert_array_equal(alone[0], np.asarray(own)[0])
