"""The effective radius in fits: where it is listed, and what is written of it."""

import dataclasses
import json

import pytest
from tests.fit_results import made_up_result
from tests.scenes import NIGHT, write_scene

from cloudjax import load_classes, put, value_at
from cloudjax_fit.fit_files import write_fit
from cloudjax_fit.fit_inputs import read_inputs
from cloudjax_fit.parameter_file import read_parameters


RADIUS = "low_stratus.optics.particles.effective_radius_um"


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return write_scene(tmp_path_factory.mktemp("scene"), (1, 3, 5, 7, 13))


def _radii(inputs):
    return {p.name: p for p in inputs.parameters if p.name.endswith(".radius")}


@pytest.mark.parametrize("bands", [(1, 5, 13), (1, 7, 13)])
def test_radii_are_fitted_where_a_band_tells_them(scene, bands):
    found = _radii(read_inputs(scene, bands=bands))
    water, ice = found["low_stratus.radius"], found["cirrus.radius"]
    assert (water.default, water.lower, water.upper, water.unit) == (10, 4, 30, "µm")
    assert (ice.default, ice.lower, ice.upper) == (39, 10, 60)
    assert all(p.free and p.log for p in found.values())


def test_radii_are_assumed_where_no_band_tells_them(scene, tmp_path):
    assert not _radii(read_inputs(scene, bands=(1, 3, 13)))
    # 3.9 µm tells them by the light of the sun.
    night = write_scene(tmp_path, (7, 13), start=NIGHT)
    assert not _radii(read_inputs(night))


def test_a_fitted_radius_is_written_and_read_back(scene, tmp_path):
    result = made_up_result(read_inputs(scene, bands=(1, 5, 13)))
    fitted = put(result.scene, {RADIUS: 14.0})
    write_fit(dataclasses.replace(result, scene=fitted), tmp_path)
    numbers = json.loads((tmp_path / "fit.json").read_text())
    assert numbers["parameters"]["low_stratus.radius"]["unit"] == "µm"
    low = numbers["clouds"]["low_stratus"]
    assert low["effective_radius_um"] == 14.0
    # Water of a given extinction is in proportion to the radius, nearly.
    assert low["water_content_g_m3"] == pytest.approx(1.4 * 0.04 / 0.1575, rel=0.02)
    page = (tmp_path / "report.html").read_text()
    assert "low_stratus.radius" in page
    assert "µm" in page[page.index("low_stratus.radius") :][:300]
    # Values of a made-up result are 1.1 times the defaults.
    written = tmp_path / "parameters.toml"
    one = load_classes(written)["low_stratus"]
    assert one.effective_radius_um == pytest.approx(11.0)
    assert one.infrared_ratio is None
    again = read_inputs(scene, bands=(1, 13), fitted=read_parameters(written))
    assert float(value_at(again.made_of.build(), RADIUS)) == pytest.approx(11.0)
