"""The files of a fit: what is in them, and that none of them looks whole alone."""

import dataclasses
import json
import os

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr
from tests.fit_results import made_up_result
from tests.scenes import write_scene

from cloudjax import load_classes
from cloudjax_data import DataError
from cloudjax_fit.fit_files import fit_numbers, write_fit
from cloudjax_fit.fit_inputs import read_inputs
from cloudjax_fit.parameter_file import read_parameters
from cloudjax_fit.radiance_files import read_radiances
from cloudjax_fit.scene_parameters import scene_parameters
from cloudjax_fit.texture import TexturePair, texture


FILES = {"fit.json", "parameters.toml", "report.html", "simulated.nc"}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return read_inputs(write_scene(tmp_path_factory.mktemp("scene")))


@pytest.fixture(scope="module")
def result(run):
    return made_up_result(run)


@pytest.fixture(scope="module")
def folder(run, result, tmp_path_factory):
    folder = tmp_path_factory.mktemp("out") / "fit"
    write_fit(result, folder, run.observed)
    return folder


def test_all_files_are_there_and_nothing_else(folder):
    assert {file.name for file in folder.iterdir()} == FILES


def test_the_numbers_are_what_the_contract_says(folder, result):
    numbers = json.loads((folder / "fit.json").read_text())
    assert numbers["status"] == "converged"
    assert numbers["seconds"] == {"compile": 1.0, "solve": 2.0, "total": 3.5}
    assert set(numbers["bands"]) == {"1", "3", "13"}
    band, distances = numbers["bands"]["13"], result.distances_fit[13]
    assert band["units"] == "mW m-2 sr-1 (cm-1)-1"
    assert band["n_pixels"] == distances.n_observed
    assert band["w1_fit"] == distances.w1
    assert band["w1_fit_over_std"] == pytest.approx(distances.w1 / band["std_observed"])
    assert band["w1_start"] > band["w1_fit"]
    assert band["ks_fit"] == distances.ks
    threshold = numbers["parameters"]["low_stratus.threshold"]
    assert {"value", "std", "determined"} <= set(threshold)
    assert {"scene", "versions", "history", "undetermined", "seeds"} <= set(numbers)
    assert set(numbers["cloud_fraction"]) == {"observed", "start", "simulated"}


def test_textures_of_both_images_are_compared(folder, run, result):
    """Power of the whole images, increments where the rule finds cloud in each."""
    band = json.loads((folder / "fit.json").read_text())["bands"]["13"]
    observed, simulated = run.observed[13], result.image.band(13)
    good = run.target.good
    seen = np.stack([run.observed[n].ravel() for n in (1, 3, 13)])
    weights = run.target.imagery.rule.weights(
        jnp.asarray(np.nan_to_num(seen), float), run.target.imagery.empty_scene
    )
    clouds = np.asarray(weights).reshape(good.shape) > 0.5, result.image.cloud > 0.5
    one, other = (
        texture(image, good, cloud)
        for image, cloud in zip((observed, simulated), clouds, strict=True)
    )
    assert band["texture"] == TexturePair(one, other).numbers()
    assert "Spectra and increments of C13" in (folder / "report.html").read_text()
    assert "texture" not in fit_numbers(result)["bands"]["13"]


def test_depth_and_water_of_each_class_stand_beside_the_parameters(folder):
    """τ = 5 everywhere; 0.04/13.3 of the paper's light is 0.04 1/m, 0.254 g/m³."""
    numbers = json.loads((folder / "fit.json").read_text())
    low = numbers["clouds"]["low_stratus"]
    assert low["optical_depth"] == {"lower": 5.0, "median": 5.0, "upper": 5.0}
    assert low["physical_extinction_per_m"] == pytest.approx(0.04)
    assert low["water_content_g_m3"] == pytest.approx(0.04 / 0.1575, rel=1e-3)
    assert low["thickness_m"] == pytest.approx(125.0)
    # 2/3 τ r_e of water's density, for particles that extinguish twice their shadow.
    assert low["water_path_g_m2"] == pytest.approx(2 / 3 * 5 * 10, rel=0.06)
    assert low["believable"]
    page = (folder / "report.html").read_text()
    assert page.index("<h2>Clouds</h2>") < page.index("<h2>Parameters</h2>")
    assert "0.254" in page
    assert "beyond" not in page


def test_water_that_no_one_has_measured_is_marked(result, tmp_path):
    thin = eqx.tree_at(
        lambda s: [layer.extinction_per_m for layer in s.layers],
        result.scene,
        [jnp.asarray(1e-5) for _ in result.scene.layers],
    )
    write_fit(dataclasses.replace(result, scene=thin), tmp_path)
    assert "⚠ beyond" in (tmp_path / "report.html").read_text()
    numbers = json.loads((tmp_path / "fit.json").read_text())
    assert not numbers["clouds"]["low_stratus"]["believable"]


def test_what_is_not_finite_is_null(folder):
    # JSON has no NaN, and readers other than Python's refuse it.
    text = (folder / "fit.json").read_text()
    assert "NaN" not in text
    assert json.loads(text)["parameters"]["low_stratus.threshold"]["std"] is None


def test_a_fit_that_did_not_converge_is_marked(run):
    numbers = fit_numbers(made_up_result(run, converged=False))
    assert numbers["status"] == "not converged"
    assert numbers["message"] == "The solver gave up."


def test_parameters_come_back(folder, result):
    fitted = read_parameters(folder / "parameters.toml")
    assert fitted.light == "physical"
    expected = {e.parameter.name: e.value for e in result.estimates}
    expected |= {p.name: p.default for p in result.held}
    own = {n: v for n, v in expected.items() if n.startswith(("air", "light"))}
    assert fitted.values == pytest.approx(own)
    made_of = dataclasses.replace(result.made_of, known=fitted.classes, placed=False)
    back = {p.name: p for p in scene_parameters(made_of)}
    for name in expected.keys() - own.keys():
        assert back[name].default == pytest.approx(expected[name])
    for parameter in (e.parameter for e in result.estimates):
        same = back[parameter.name]
        for number in ("lower", "upper", "spread"):
            assert getattr(same, number) == pytest.approx(getattr(parameter, number))
        assert (same.path, same.log) == (parameter.path, parameter.log)


def test_the_parameters_are_classes_in_physical_terms(folder, result):
    """Of 0.04 per metre, a tenth more."""
    classes = load_classes(folder / "parameters.toml")
    assert list(classes) == list(result.target.imagery.fractions)
    assert classes["low_stratus"].extinction_per_m == pytest.approx(0.044)
    assert classes["low_stratus"].conditions.sampling_altitude_m == 2000
    assert [t.weight for t in classes["cirrus"].textures] == pytest.approx([1.0, 0.385])


def test_parameters_of_earlier_versions_are_read(tmp_path):
    path = tmp_path / "parameters.toml"
    path.write_text(
        'light_strategy = "physical"\n[low_stratus]\ntop = 900\n[air]\ngain_C13 = 1.01'
    )
    fitted = read_parameters(path)
    assert fitted.classes is None
    assert fitted.light == "physical"
    assert fitted.values == {"low_stratus.top": 900.0, "air.gain_C13": 1.01}


@pytest.mark.parametrize(
    ("text", "words"),
    [("a = 3.0", "outside of a section"), ("[a]\nb = true", "make it a finite number"),
     ("[a", "not valid TOML")],
)  # fmt: skip
def test_parameters_that_cannot_be_read_are_refused(tmp_path, text, words):
    path = tmp_path / "parameters.toml"
    with pytest.raises(DataError, match="is not a file"):
        read_parameters(path)
    path.write_text(text)
    with pytest.raises(DataError, match=words):
        read_parameters(path)


def test_the_image_is_cf_and_georeferenced(folder, result):
    with xr.open_dataset(folder / "simulated.nc", decode_coords="all") as data:
        assert data.attrs["Conventions"] == "CF-1.8"
        radiance = data["radiance_C13"]
        assert radiance.dims == ("y", "x")
        assert radiance.attrs["abi_band"] == 13
        assert radiance.attrs["units"] == "mW m-2 sr-1 (cm-1)-1"
        mapping = data[radiance.encoding["grid_mapping"]]
        assert mapping.attrs["grid_mapping_name"] == "geostationary"
        assert data["time"].to_numpy() == np.datetime64(
            result.target.imagery.time.replace(tzinfo=None), "ns"
        )
        np.testing.assert_array_equal(radiance, result.image.band(13))
        np.testing.assert_array_equal(data["cloud_weight"], result.image.cloud)
        np.testing.assert_array_equal(data["x"], result.target.imagery.grid.x_rad)
        assert "low_stratus.threshold" in json.loads(data.attrs["parameters"])
        assert data.attrs["seed"] == 7


def test_the_image_can_be_compared(folder, result):
    bands = read_radiances(folder / "simulated.nc")
    np.testing.assert_array_equal(bands[3].values, result.image.band(3))


def test_the_report_shows_both_images_and_the_warning(folder):
    page = (folder / "report.html").read_text()
    assert page.count("data:image/png") == 3
    assert "Mind the step." in page
    assert "reflectance" in page


def test_a_scene_without_images_is_reported_too(result, tmp_path):
    write_fit(result, tmp_path)
    assert (tmp_path / "report.html").read_text().count("data:image/png") == 3


def test_a_failure_leaves_the_files_of_an_earlier_run(result, tmp_path, monkeypatch):
    write_fit(dataclasses.replace(result, warnings=["an earlier run"]), tmp_path)
    monkeypatch.setattr("cloudjax_fit.fit_files.write_fit_report", _full_disk)
    with pytest.raises(DataError, match=r"No space left on device.*free some space"):
        write_fit(result, tmp_path)
    assert {file.name for file in tmp_path.iterdir()} == FILES
    assert "an earlier run" in (tmp_path / "fit.json").read_text()


def test_an_interruption_leaves_nothing_half_written(result, tmp_path, monkeypatch):
    monkeypatch.setattr("cloudjax_fit.fit_files.write_fit_report", _interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_fit(result, tmp_path)
    assert not list(tmp_path.iterdir())


def test_the_numbers_come_last_and_old_ones_go_first(result, tmp_path, monkeypatch):
    write_fit(result, tmp_path)
    moved = []

    def failing_move(source, target, replace=os.replace):
        if target.parent != tmp_path:
            return replace(source, target)
        moved.append(target.name)
        raise OSError(5, "Input/output error")

    monkeypatch.setattr("cloudjax_data.whole_files.os.replace", failing_move)
    with pytest.raises(DataError, match="Input/output error"):
        write_fit(result, tmp_path)
    assert len(moved) == 1
    assert moved != ["fit.json"]
    assert not (tmp_path / "fit.json").exists()


def _full_disk(*_):
    raise OSError(28, "No space left on device")


def _interrupted(*_):
    raise KeyboardInterrupt
