"""`cloudjax report` with a weather model: what is rendered, and what is refused."""

import json
from datetime import timedelta
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from cloudjax import FixedGrid
from cloudjax_data import is_wrf
from cloudjax_scenes.band_image import BandImage
from tests.commands import run, sentence_of
from tests.generated import SCAN_START, default_calibration, write_abi_l1b
from tests.generated_wrf import write_wrf


PLACE = 20.0, -80.0
# 7 x 6 columns of 20 km.
SIZE = {"DX": 20e3, "DY": 20e3}
SAID = "%Y-%m-%d_%H:%M:%S"


def _grid(step_km=2.0, pixels=200, east_km=0) -> FixedGrid:
    """A part of the fixed grid around the model's middle."""
    step = step_km * 28e-6
    x, y = FixedGrid.abi_full_disc(10.0).scan_angles_rad(*PLACE)
    x, y = (round(angle / 56e-6) * 56e-6 for angle in (x + east_km * 28e-6, y))
    half = (np.arange(pixels) - (pixels - 1) / 2) * step
    return FixedGrid(x + half, y - half, -75.0)


def _specks(shape) -> np.ndarray:
    """So little that means are the same, and enough for textures."""
    return 0.1 * np.random.default_rng(0).standard_normal(shape)


def _scene(folder: Path, fine=1, **where) -> Path:
    """Bands 2 and 13, the former on pixels that are so much finer."""
    folder.mkdir()
    for band, times, value in ((2, fine, 0.3), (13, 1, 280.0)):
        grid = _grid(2 / times, 200 * times, **where)
        seen = default_calibration(band).radiance(np.full(grid.shape, value))
        seen += _specks(grid.shape)
        write_abi_l1b(
            folder, band=band, radiance=seen, grid=grid, platform="G16",
            orbital_slot="GOES-East",
        )  # fmt: skip
    return folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("beside")
    _scene(folder / "scene", fine=4)
    _scene(folder / "aside", east_km=240)
    _scene(folder / "elsewhere", east_km=600)
    for name, minutes in (("model.nc", (-70, 20)), ("early", (-90,))):
        times = [SCAN_START + timedelta(minutes=m) for m in minutes]
        flat = np.zeros((6, 7))
        write_wrf(
            folder / name, flat, flat, SIZE, times=[t.strftime(SAID) for t in times]
        )
    return folder


@pytest.fixture
def rendered(monkeypatch):
    """What was to be rendered; as if all of it were of one radiance."""
    asked = []

    def render_strips(world, sensor, bands, time, **options):
        asked.append((world, sensor, [band.number for band in bands], time))

        def band(number):
            seen = np.full(sensor.view.shape, 50.0) + _specks(sensor.view.shape)
            own = sensor.bands[number]
            return BandImage(own, own.coefficients(), seen)

        return [SimpleNamespace(band=band)]

    monkeypatch.setattr("cloudjax_fit.model_as_seen.render_strips", render_strips)
    return asked


def _report(folder, a, b, *options):
    given = "--place", "20,-80", "-o", folder / "out"
    return run("report", folder / a, folder / b, *given, *options)


@pytest.mark.parametrize("order", [("scene", "model.nc"), ("model.nc", "scene")])
def test_the_model_is_seen_as_the_scene_was(folder, rendered, order):
    result = _report(folder, *order)
    assert result.exit_code == 0, (result.output, result.exception)
    ((world, sensor, bands, time),) = rendered
    assert bands == [2, 13]
    # The sun is that of the scene, the clouds are those of the nearest time.
    assert abs(time - SCAN_START) < timedelta(seconds=10)
    assert abs(world.columns.time - time) < timedelta(minutes=25)
    whole = _grid()
    assert sensor.view.step_rad == pytest.approx(56e-6)
    assert set(np.round(sensor.view.x_rad, 9)) < set(np.round(whole.x_rad, 9))
    # 120 km, which is 60 pixels, seen at a slant from north to south.
    assert 40 < sensor.view.shape[0] < 62
    found = json.loads((folder / "out" / "report.json").read_text())
    assert (found["a"], found["b"]) == tuple(str(folder / name) for name in order)
    assert found["bands"]["13"]["n_observed"] == found["bands"]["13"]["n_simulated"]
    (thermal,) = default_calibration(13).radiance(np.array([280.0]))
    sign = 1 if order[0] == "scene" else -1
    assert found["bands"]["13"]["bias"] == pytest.approx(
        sign * (50 - thermal), abs=0.05
    )
    assert found["warnings"] == ["The file has no ice: all cloud in it is of water."]
    assert found["clouds"]["heights_by"] == "the mean air of the model"


def test_bands_and_pixels_are_those_that_are_asked(folder, rendered):
    options = "--bands", "13", "--resolution-km", "4"
    assert _report(folder, "scene", "model.nc", *options).exit_code == 0
    assert _report(folder, "scene", "model.nc", "--bands", "2").exit_code == 0
    (_, coarse, bands, _), (_, fine, *_) = rendered
    assert bands == [13]
    assert coarse.view.step_rad == pytest.approx(4 * 28e-6)
    assert fine.view.step_rad == pytest.approx(0.5 * 28e-6)


REFUSED = {
    "time": (
        ("scene", "early"),
        (),
        "the model is of 2019-10-27 18:30 UTC and the image of 2019-10-27 20:00 UTC, "
        "90 minutes apart; give a model and an image of one place and time, or compare "
        "these all the same with --allow-mismatch",
    ),
    "asked time": (
        ("scene", "model.nc"),
        ("--time", (SCAN_START - timedelta(minutes=70)).strftime("%Y-%m-%dT%H:%M:%S")),
        "70 minutes apart",
    ),
    "place": (("aside", "model.nc"), (), "of the columns are in the image and"),
    "nowhere": (
        ("elsewhere", "early"),
        ("--allow-mismatch",),
        "around longitude -80, and the image at",
    ),
    "both models": (("early", "model.nc"), (), "both of a weather model"),
    "no model": (("scene", "scene"), (), "leave out --place"),
    "band": (("scene", "model.nc"), ("--bands", "3"), "does not hold band 3"),
    "pixels": (
        ("scene", "model.nc"),
        ("--resolution-km", "3"),
        "do not fill those of 3 km",
    ),
}


@pytest.mark.parametrize(("names", "options", "said"), REFUSED.values(), ids=REFUSED)
def test_what_does_not_match_is_refused(folder, rendered, names, options, said):
    assert said in sentence_of(_report(folder, *names, *options))
    assert not rendered


@pytest.mark.parametrize("names", [("scene", "early"), ("aside", "model.nc")])
def test_what_is_allowed_is_told_on_top(folder, rendered, names):
    result = _report(folder, *names, "--allow-mismatch")
    assert result.exit_code == 0, (result.output, result.exception)
    assert "No match: the model is " in result.output
    found = json.loads((folder / "out" / "report.json").read_text())
    assert found["warnings"][0].startswith("No match: the model is ")
    assert len(rendered) == 1


def test_files_of_a_model_are_known_by_what_they_hold(folder):
    assert is_wrf(folder / "model.nc")
    assert is_wrf(folder / "early")
    (image,) = (folder / "scene").glob("*C13*")
    for other in (folder / "scene", folder / "none", image, Path(__file__)):
        assert not is_wrf(other)


@pytest.mark.shared_data
def test_a_hurricane_is_not_in_california(shared_data, tmp_path):
    result = run(
        "report",
        shared_data / "wrf_katrina_20050828" / "wrfout_katrina_10km.nc",
        shared_data / "goes17_m1_20191027T2000",
        *("--bands", "13", "-o", tmp_path / "out"),
    )
    said = sentence_of(result)
    assert "14.2 years apart" in said
    assert "around longitude -90.89, and the image at" in said
