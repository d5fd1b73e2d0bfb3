"""Parameters of a scene by path: found, changed, differentiated, and misspelt."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import (
    EmissiveBands,
    ReflectiveBands,
    Scene,
    StandardAtmosphere,
    TwoFlux,
    bands_named,
    class_layer,
    imagery_classes,
    paths,
    put,
    value_at,
)


BANDS = bands_named(1, 3, 13)
SCENE = Scene(
    layers=tuple(
        class_layer(one, sunlit=(1, 3), thermal=(13,))
        for one in imagery_classes().values()
    ),
    reflective=ReflectiveBands.of(BANDS),
    emissive=EmissiveBands.of(BANDS),
    reflection=TwoFlux(indirect=jnp.asarray(0.3)),
    temperature=StandardAtmosphere(),
)


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("layers.low_stratus.cloud.function.threshold", -1.21),
        ("low_stratus.cloud.function.threshold", -1.21),
        ("cirrus.cloud.function.weights.1", 0.35),
        ("layers.cirrus.extinction_per_m", 0.003),
        ("layers.1.extinction_per_m", 0.012),
        ("reflective.gain.1", 1.0),
        ("reflection.indirect", 0.3),
        ("temperature.offset_k", 0.0),
    ],
)
def test_a_path_leads_to_a_number(path, value):
    assert float(value_at(SCENE, path)) == pytest.approx(value)
    changed = put(SCENE, {path: value + 1})
    assert float(value_at(changed, path)) == pytest.approx(value + 1)
    assert jax.tree.structure(changed) == jax.tree.structure(put(SCENE, {path: value}))


def test_several_numbers_are_put_at_once_and_the_rest_stays():
    changed = put(
        SCENE,
        {
            "cirrus.cloud.function.weights.1": 0.7,
            "layers.cirrus.cloud.function.persistences.0": 0.9,
            "reflective.path": np.array([0.1, 0.2]),
        },
    )
    weights = value_at(changed, "cirrus.cloud.function.weights")
    np.testing.assert_allclose(weights, [1.0, 0.7])
    moved = {
        path
        for path in paths(SCENE)
        if not np.array_equal(value_at(changed, path), value_at(SCENE, path))
    }
    assert moved == {
        "layers.cirrus.cloud.function.weights",
        "layers.cirrus.cloud.function.weights.1",
        "layers.cirrus.cloud.function.persistences",
        "layers.cirrus.cloud.function.persistences.0",
        "reflective.path",
        "reflective.path.0",
        "reflective.path.1",
    }


def test_every_listed_path_can_be_read_and_put():
    known = paths(SCENE)
    assert len(known) == len(set(known))
    values = {path: value_at(SCENE, path) for path in known}
    back = put(SCENE, values)
    for one, other in zip(jax.tree.leaves(back), jax.tree.leaves(SCENE), strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize(
    ("path", "near"),
    [
        ("low_stratus.cloud.function.treshold", "low_stratus.cloud.function.threshold"),
        ("layers.cirus.extinction_per_m", "layers.cirrus.extinction_per_m"),
        ("reflective.gain.2", "reflective.gain"),
        ("reflective", "reflective"),
        ("cirrus.steps", "cirrus"),
        ("temperature.offset_k.0", "temperature.offset_k"),
    ],
)
def test_a_wrong_path_is_named_with_the_nearest(path, near):
    for wrong in (lambda: value_at(SCENE, path), lambda: put(SCENE, {path: 1.0})):
        with pytest.raises(ValueError, match=f"'{path}'.*nearest one is '{near}"):
            wrong()


def test_a_value_of_another_shape_is_refused():
    with pytest.raises(ValueError, match=r"reflective\.gain has the shape \(2,\)"):
        put(SCENE, {"reflective.gain": 1.0})


def test_paths_work_in_jit_grad_and_vmap():
    def water(value):
        scene = put(SCENE, {"cirrus.extinction_per_m": value})
        return (scene.layers[0].sunlit_per_m ** 2).sum()

    at = jnp.asarray(0.5)
    slope = float(jax.jit(jax.grad(water))(at))
    assert slope == pytest.approx(2 * float(water(at)) / 0.5, rel=1e-5)
    many = jax.vmap(water)(jnp.asarray([0.5, 1.0]))
    np.testing.assert_allclose(many, [water(at), 4 * water(at)], rtol=1e-5)


def test_a_scene_with_changed_numbers_is_compiled_once():
    traced = []

    @jax.jit
    def extinction(scene):
        traced.append(scene)
        return value_at(scene, "cirrus.extinction_per_m")

    found = [
        float(extinction(put(SCENE, {"cirrus.extinction_per_m": value})))
        for value in (0.1, 0.2)
    ]
    assert found == pytest.approx([0.1, 0.2])
    assert len(traced) == 1
