"""Fits of a user's own classes of cloud, and what a fit gives back to renders."""

import pickle

import jax
import numpy as np
import pytest
import tomli_w
from tests.fit_results import made_up_result
from tests.scenes import write_scene

from cloudjax import class_table, cloud_classes, imagery_classes, load_classes
from cloudjax_data import DataError
from cloudjax_fit import embedded_target, fit, scene_parameters
from cloudjax_fit.fit_files import write_fit
from cloudjax_fit.fit_inputs import read_inputs
from cloudjax_fit.fitted_image import fitted_values
from cloudjax_fit.objective import pose, residuals
from cloudjax_fit.parameter_file import read_parameters
from cloudjax_fit.parameters import unbounded_of
from cloudjax_scenes import SceneFromImagery


MINE = ["my_cirrus", "my_thick_cold", "my_low_stratus"]


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return write_scene(tmp_path_factory.mktemp("scene"))


def write_classes(path, *, paper: bool = False, **changes):
    """The classes of fits with other names, and one of Table 1 without a rule."""
    tables = {
        f"my_{name}": class_table(one) | changes
        for name, one in imagery_classes(paper_light=paper).items()
    }
    tables["altostratus"] = class_table(cloud_classes()["altostratus"])
    path.write_text(tomli_w.dumps(tables))
    return path


def test_a_fit_takes_the_classes_of_a_file(scene, tmp_path):
    file = write_classes(tmp_path / "mine.toml", mask_gain=1.5)
    inputs = read_inputs(scene, classes=file)
    assert list(inputs.made_of.imagery.fractions) == MINE
    found = {p.name: p for p in inputs.parameters}
    assert found["my_cirrus.mask_gain"].default == 1.5
    assert not any(name.startswith("altostratus") for name in found)
    # As the built-in ones of the same rules, but for the names.
    usual = read_inputs(scene).made_of.imagery.fractions
    np.testing.assert_array_equal(
        inputs.made_of.imagery.fractions["my_cirrus"], usual["cirrus"]
    )


def test_the_settings_of_a_scene_name_its_classes(tmp_path):
    scene = write_scene(tmp_path / "scene")
    write_classes(scene / "mine.toml")
    (scene / "scene.toml").write_text('[fit]\nclasses = "mine.toml"\n')
    layers = [layer.name for layer in read_inputs(scene).made_of.build().layers]
    assert layers == MINE
    (scene / "scene.toml").write_text('[fit]\nclasses = "yours.toml"\n')
    with pytest.raises(DataError, match=r"yours\.toml is not a file"):
        read_inputs(scene)


def test_high_cloud_is_left_out_where_no_window_band_tells_it(scene):
    low = read_inputs(scene, bands=(1, 3)).made_of
    assert [one.name for one in low.classes] == ["low_stratus"]


def test_classes_that_no_pixel_belongs_to_are_refused(scene, tmp_path):
    file = tmp_path / "table_1.toml"
    classes = cloud_classes().items()
    file.write_text(tomli_w.dumps({name: class_table(one) for name, one in classes}))
    with pytest.raises(DataError, match=r"None of the classes low_stratus.*imagery"):
        read_inputs(scene, classes=file)


@pytest.mark.parametrize("light", ["paper", "physical"])
def test_what_a_fit_writes_renders_its_scene_again(scene, tmp_path, light):
    """Values come back through the file of classes, to rounding, for either light."""
    file = write_classes(tmp_path / "mine.toml", paper=light == "paper")
    inputs = read_inputs(scene, classes=file, options={"light": light})
    result = made_up_result(inputs)
    write_fit(result, tmp_path / "out")
    written = tmp_path / "out" / "parameters.toml"
    assert list(load_classes(written)) == (MINE if light == "physical" else MINE[::2])
    again = read_inputs(scene, fitted=read_parameters(written))
    assert again.made_of.light.name == light
    values = fitted_values(again)
    expected = {e.parameter.name: e.value for e in result.estimates}
    expected |= {held.name: held.default for held in result.held}
    assert values == pytest.approx(expected)


def test_parameters_of_an_earlier_version_still_count(scene, tmp_path):
    """In the units of the light: the paper's extinction is a share of the physical."""
    file = tmp_path / "parameters.toml"
    file.write_text(
        'light_strategy = "paper"\n[low_stratus]\nextinction = 0.005\n'
        "[air]\ngain_C13 = 1.01\ngain_C15 = 1.0\n"
    )
    values = fitted_values(read_inputs(scene, fitted=read_parameters(file)))
    assert values["low_stratus.extinction"] == 0.005
    assert values["air.gain_C13"] == 1.01
    assert "air.gain_C15" not in values
    file.write_text("[low_stratus]\ntop = 90000\n")
    with pytest.raises(DataError, match=r"parameters\.toml gives low_stratus\.top = 9"):
        fitted_values(read_inputs(scene, fitted=read_parameters(file)))


def test_parameters_are_compared_hashed_and_pickled():
    made_of = SceneFromImagery(embedded_target().imagery)
    one, other = (tuple(scene_parameters(made_of)) for _ in range(2))
    assert one == other
    assert hash(one) == hash(other)
    assert pickle.loads(pickle.dumps(one)) == one


def test_fits_of_scenes_with_one_structure_are_compiled_once():
    """Two seeds: other textures, other rays, the same functions."""
    target, traced = embedded_target(), []

    @jax.jit
    def loss(z, problem):
        traced.append(z)
        return (residuals(z, problem) ** 2).sum()

    found = []
    for seed in (0, 1):
        made_of = SceneFromImagery(target.imagery, seed=seed, steps=2)
        parameters = scene_parameters(made_of)
        problem, _ = pose(target, made_of.build(), parameters, rays=16, seed=seed)
        found.append(float(loss(unbounded_of(parameters), problem)))
    assert found[0] != found[1]
    assert len(traced) == 1


def test_a_scene_is_built_once_before_the_first_residual(scene, monkeypatch):
    built, build = [], SceneFromImagery.build
    monkeypatch.setattr(
        SceneFromImagery, "build", lambda self: built.append(self) or build(self)
    )
    monkeypatch.setattr("cloudjax_fit.fittable_scene.pose", _stop)
    inputs = read_inputs(scene)
    assert not built
    with pytest.raises(StopIteration):
        fit(inputs.target, settings=inputs.settings.fit, overrides=inputs.overrides)
    assert len(built) == 1


def _stop(*_, **__):
    raise StopIteration
