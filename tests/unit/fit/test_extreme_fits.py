"""Scenes from which hardly anything can be fitted: what is said of them."""

import numpy as np
import pytest
from tests.generated import (
    SCAN_START,
    default_calibration,
    window,
    write_abi_l1b,
    write_grib,
)
from tests.scenes import NIGHT
from tests.small_fits import HELD, flecked, small_class, small_imagery, small_target

from cloudjax_data import DataError, read_weather
from cloudjax_fit import fit
from cloudjax_fit.cautions import cautions
from cloudjax_fit.fit_files import REPORT, write_fit
from cloudjax_fit.fit_inputs import read_inputs
from cloudjax_fit.fit_result import FitResult
from cloudjax_fit.fit_settings import FitSettings
from cloudjax_scenes import Analysis


SHAPE = (64, 64)
SETTINGS = FitSettings(rays=576, steps=5, max_steps=4, seed=3, statistics="values")


def _night(folder, **kelvin):
    """Bands of a night scene, by name such as c13."""
    for name, image in kelvin.items():
        band = int(name[1:])
        radiance = default_calibration(band).radiance(image)
        write_abi_l1b(
            folder, band=band, radiance=radiance, grid=window(SHAPE), start=NIGHT
        )
    return folder


def _half(east: bool) -> np.ndarray:
    """Cloud over seven tenths of one half."""
    rng = np.random.default_rng(1)
    cloud = (rng.random(SHAPE) < 0.7) & ((np.arange(64) >= 32) == east)
    return np.where(cloud, rng.uniform(225, 255, SHAPE), 288.0)


def _assert_finite(result: FitResult) -> None:
    assert np.isfinite(result.history).all()
    found = [(e.value, e.std) for e in result.estimates]
    assert np.isfinite(found).all()
    assert np.isfinite(result.image.radiance).all()


def test_one_cloud_pixel_is_too_few(tmp_path):
    clear = np.full(SHAPE, 288.0)
    clear[30, 30] = 230.0
    with pytest.raises(DataError, match=r"holds 1 cloud pixels .* needs 500"):
        read_inputs(_night(tmp_path, c13=clear))


def test_a_start_at_a_bound_is_refused(tmp_path):
    _night(tmp_path, c13=_half(True))
    text = '[parameters."thick_cold.extinction"]\ndefault = 1.0\n'
    (tmp_path / "scene.toml").write_text(text)
    with pytest.raises(DataError, match=r"scene.toml: thick_cold.extinction = 1 is"):
        read_inputs(tmp_path)


def test_bands_that_contradict_each_other_are_told(tmp_path):
    """What is cloud to band 13 is clear sky to band 15: a fit was a fault of the
    program."""
    inputs = read_inputs(_night(tmp_path, c13=_half(True), c15=_half(False)))
    earth = inputs.target.imagery.grid.sees_the_earth()
    (said,) = cautions(inputs.target, [], {}, earth)
    assert said.startswith("Band 15 is the same in all cloud pixels")


def test_a_fit_to_bands_that_contradict_each_other_says_so(tmp_path):
    """What is bright cloud to band 1 is as warm as the sea to band 13."""
    images = flecked()
    images[13] = np.full_like(images[13], images[13].max())
    result = fit(
        small_target(small_imagery(), images),
        settings=SETTINGS,
        classes={"low": small_class()},
        overrides=HELD,
    )
    _assert_finite(result)
    told = write_fit(result, tmp_path)["warnings"]
    (said,) = (one for one in told if "Band 13" in one)
    assert said.startswith("Band 13 is the same in all cloud pixels")
    assert said in (tmp_path / REPORT).read_text()


# NaN in the weather -------------------------------------------------------------------

LEVELS = {1000: 110.0, 700: 3000.0, 500: 5600.0, 300: 9200.0}
AIR = {"u": 10.0, "v": 2.0, "w": 0.1, "r": 60.0, "t": 270.0}
EVERY = (*AIR, "gh")
# By name, the levels at which fields are missing.
BELOW_GROUND = dict.fromkeys(EVERY, (1000,))
NOTHING = dict.fromkeys(EVERY, tuple(LEVELS))
NEVER_TOGETHER = {"r": (500, 300), "t": (1000, 700)}


def _analysis(folder, imagery, missing, everywhere: bool = False) -> Analysis:
    """Uniform air, with a meridian of nodes through the middle of some imagery.

    **Arguments:** `missing`: in columns west of that meridian; `everywhere`: in those
    of the meridian, too.
    """
    latitude = np.arange(90.0, -91.0, -5.0)
    middle = imagery.longitude_deg.mean() % 360
    longitude = middle % 5 + np.arange(0.0, 360.0, 5.0)
    away = middle - longitude
    west = (away > (-1 if everywhere else 1)) & (away < 6)
    near = np.abs(latitude - imagery.latitude_deg.mean()) < 20
    hole = near[:, None] & west
    fields = {
        (name, level): np.where(hole & (level in missing.get(name, ())), np.nan, value)
        for level, height in LEVELS.items()
        for name, value in (AIR | {"gh": height}).items()
    }
    file = write_grib(
        folder / "gfs.grib2",
        fields,
        latitude_deg=latitude,
        longitude_deg=longitude,
        time=SCAN_START,
    )
    return Analysis(read_weather(file))


@pytest.mark.parametrize(
    ("missing", "shares"),
    [(BELOW_GROUND, []), (NOTHING, ["gfs.grib2 holds"]), (NEVER_TOGETHER, [])],
    ids=["below ground", "nothing", "never together"],
)
def test_fits_of_weather_with_gaps_are_finite(tmp_path, missing, shares):
    """Half of the scene is between nodes of which some are masked."""
    imagery = small_imagery()
    result = fit(
        small_target(imagery, flecked()),
        _analysis(tmp_path, imagery, missing),
        settings=SETTINGS,
        classes={"low": small_class(hours=1.0)},
        overrides=HELD,
    )
    _assert_finite(result)
    assert [w[:15] for w in result.warnings if "of the scene: the air" in w] == shares


def test_weather_that_is_masked_over_all_the_scene_is_refused(tmp_path):
    imagery = small_imagery()
    analysis = _analysis(tmp_path, imagery, NOTHING, everywhere=True)
    with pytest.raises(DataError, match=r"gfs.grib2 covers .* nothing of the scene"):
        fit(small_target(imagery, flecked()), analysis, classes={"low": small_class()})
