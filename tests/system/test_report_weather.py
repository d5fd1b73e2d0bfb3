"""`cloudjax report IMAGE --weather ANALYSIS` as its users meet it."""

import json
import re

import numpy as np
import pytest
import xarray as xr

from tests.commands import run, sentence_of


def _report(image, weather, folder, *more):
    return run("report", image, "--weather", weather, "-o", folder, *more)


@pytest.fixture(scope="module")
def reported(rendered, weather_folder, tmp_path_factory):
    folder = tmp_path_factory.mktemp("reported")
    result = _report(rendered, weather_folder / "gfs.grib2", folder)
    assert result.exit_code == 0, (result.output, result.exception)
    return folder, json.loads((folder / "report.json").read_text()), result.output


def test_the_numbers_are_those_of_the_file(reported, rendered):
    """A sector near the sub-satellite point has pixels alike: the cover is close to the
    plain mean of their fractions, and the tops to those of the file.
    """
    _, found, said = reported
    with xr.open_dataset(rendered) as data:
        fraction = data["cloud_fraction"].to_numpy()
        kelvin = data["brightness_temperature_C13"].to_numpy()
        clear = fraction < 0.1
    cover = found["cover"]["whole"]["total"]
    assert cover["image"] == pytest.approx(fraction.mean(), abs=0.02)
    assert cover["points"] == pytest.approx(100 * (cover["image"] - cover["analysis"]))
    band = found["bands"]["C13"]
    assert band["quantity"] == "brightness temperature (K)"
    assert abs(band["clear"]["pixels"] - clear.sum()) < 0.1 * clear.sum()
    assert band["clear"]["mean"] > band["cloudy"]["mean"]
    assert found["cold_tops"]["coldest_k"] >= kelvin.min() - 1e-3
    assert found["bands"].keys() == {"C02", "C07", "C13"}
    assert found["bands"]["C13"]["spectrum"]["pixel_km"] == pytest.approx(10.5, abs=1)
    assert np.sum(found["isccp"]["joint_percent"]) < 100 * cover["image"]
    classes = found["cover_by_class"]
    assert classes.keys() == {"low", "high"}
    assert sum(classes.values()) == pytest.approx(cover["image"], abs=0.01)
    for target in found["targets"]:
        assert target["what"] in said


def test_the_page_is_whole_and_needs_no_other_file(reported):
    folder, found, _ = reported
    page = (folder / "report.html").read_text("utf-8")
    for title in ("Verdict", "Cover", "Types of cloud", "C13", "Coldest tops"):
        assert f"{title}" in page
    assert page.count("data:image/svg+xml;base64,") == 2 + 2 * len(found["bands"])
    assert "http" not in page
    assert "cited from memory" in page
    words = re.sub(r'src="data:[^"]*"', "", page)
    assert "nan" not in words
    assert "–" in words


def test_an_analysis_of_another_time_is_compared_when_that_is_allowed(
    rendered, weather_folder, tmp_path
):
    """Of one band, which is enough for the others."""
    later = weather_folder / "later.grib2"
    said = sentence_of(_report(rendered, later, tmp_path))
    assert "3.0 hours apart" in said
    assert "--allow-mismatch" in said
    asked = "--allow-mismatch", "--bands", "13"
    result = _report(rendered, later, tmp_path, *asked)
    assert result.exit_code == 0, (result.output, result.exception)
    assert "clouds have moved" in (tmp_path / "report.html").read_text("utf-8")
    assert json.loads((tmp_path / "report.json").read_text())["bands"].keys() == {"C13"}
    refused = _report(rendered, later, tmp_path, "--allow-mismatch", "--bands", "5")
    assert "does not hold band 5" in sentence_of(refused)


def test_what_is_no_image_of_a_sensor_is_refused(rendered, weather_folder, tmp_path):
    with xr.open_dataset(rendered) as data:
        data.load().drop_vars("cloud_top_height").to_netcdf(tmp_path / "bare.nc")
    weather = weather_folder / "gfs.grib2"
    said = sentence_of(_report(tmp_path / "bare.nc", weather, tmp_path))
    assert "bare.nc has no cloud_top_height" in said
    assert "is a folder" in sentence_of(_report(tmp_path, weather, tmp_path))


def test_what_is_compared_with_is_one_thing(rendered, weather_folder, tmp_path):
    weather = weather_folder / "gfs.grib2"
    both = run("report", rendered, rendered, "--weather", weather, "-o", tmp_path)
    assert both.exit_code == 2
    assert "in place of B" in both.output
    none = run("report", rendered, "-o", tmp_path)
    assert none.exit_code == 2
    assert "--weather" in none.output
    place = _report(rendered, weather, tmp_path, "--place", "20,-80")
    assert place.exit_code == 2
    assert "--place" in place.output
