"""A weather model beside imagery, through the command line."""

import json

import numpy as np
import pytest

from tests.commands import run
from tests.generated_wrf import LEVELS, write_wrf


SHAPE = 20, 22
PLACE = "--place", "20,-80"
NOON = "2005-08-28_17:00:00"


def _model(path, *, times=(NOON,), water=1.0):
    """Some 400 km of columns with cloud at 3 to 4 km, from none in the west to
    0.03 g/kg in the east.
    """
    cloud = np.zeros((LEVELS, *SHAPE))
    cloud[3] = water * 3e-5 * np.linspace(0, 1, SHAPE[1])
    still = np.zeros(SHAPE)
    # An ideal run has no places of its own.
    size = {"DX": 20e3, "DY": 20e3}
    return write_wrf(path, still, still, size, times=times, QCLOUD=cloud)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A model, and what a geostationary imager sees of it in band 13."""
    folder = tmp_path_factory.mktemp("model")
    _model(folder / "wrfout")
    seen = run(
        *("render", "abi-meso-10km", "--centre", "20,-80", "--bands", "13"),
        *("--wrf", folder / "wrfout", *PLACE, "-o", folder / "seen.nc"),
    )
    assert seen.exit_code == 0, (seen.output, seen.exception)
    return folder


def _report(folder, *arguments):
    result = run("report", *arguments, *PLACE, "-o", folder / "out")
    assert result.exit_code == 0, (result.output, result.exception)
    page = (folder / "out" / "report.html").read_text("utf-8")
    return json.loads((folder / "out" / "report.json").read_text()), page


def test_a_model_beside_what_was_rendered_of_it_is_the_same(folder):
    """A file of `render` of a model, and the same model rendered for that file: nothing
    may differ but the rounding of float32, 1e-6 of a radiance.
    """
    found, page = _report(folder, folder / "seen.nc", folder / "wrfout")
    assert found["bands"].keys() == {"13"}
    for band in found["bands"].values():
        assert band["n_observed"] == band["n_simulated"] > 100
        assert band["w1_over_std"] < 1e-5
    clouds = found["clouds"]
    assert clouds["a"] == clouds["b"]
    assert 0.2 < clouds["a"]["cover"] < 0.8
    assert found["warnings"] == ["The file has no ice: all cloud in it is of water."]
    assert "Cover and tops" in page


def test_twice_the_water_of_hours_before_is_told(folder):
    """Twice the water is colder where it was thin, so that there is more that is cold
    and it seems to be higher; a model of another time is compared when that is allowed,
    and the report says so.
    """
    hours = ["2005-08-28_11:00:00", "2005-08-28_14:00:00"]
    _model(folder / "before", times=hours, water=2.0)
    found, page = _report(
        folder, folder / "before", folder / "seen.nc", "--allow-mismatch"
    )
    of_model, of_image = found["clouds"]["a"], found["clouds"]["b"]
    assert of_model["cover"] > of_image["cover"] + 0.05
    # B is the image, and warmer.
    band = found["bands"]["13"]
    assert band["bias"] > 0.1 * band["std_observed"]
    assert of_model["top_m"]["0.5"] > of_image["top_m"]["0.5"] + 100
    said = "the model is of 2005-08-28 14:00 UTC and the image of 2005-08-28 17:00 UTC"
    assert said in found["warnings"][0]
    assert said in page
