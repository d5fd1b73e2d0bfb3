"""Cover and tops: one rule for both, on the pixels of both bands."""

import json
from dataclasses import replace
from datetime import datetime, timedelta

import numpy as np
import pytest
from tests.generated import SCAN_START, default_calibration, window

from cloudjax import nominal_bands
from cloudjax_data import earth_sun_distance_au
from cloudjax_fit.air_column import AirColumn, standard_air
from cloudjax_fit.band_radiances import BandRadiances
from cloudjax_fit.comparison import compare, comparison_json
from cloudjax_fit.cover_and_tops import clouds_of_both


BANDS = nominal_bands()
# A quarter is dark and warm, a quarter bright and warm, half of it cold.
BRIGHT = np.array([[0.1, 0.5, 0.1, 0.1]] * 4)
KELVIN = np.array([[290.0, 285.0, 250.0, 230.0]] * 4)


def _bands(bright=BRIGHT, kelvin=KELVIN, time: datetime | None = SCAN_START, step=1):
    seen = {
        2: bright.repeat(step, 0).repeat(step, 1)
        / BANDS[2].coefficients(earth_sun_distance_au(SCAN_START))["kappa0"],
        13: default_calibration(13).radiance(kelvin),
    }
    grids = {2: window((4 * step, 4 * step), 5.6e-5 / step), 13: window((4, 4))}
    return {
        n: BandRadiances(n, BANDS[n].units, x, grid=grids[n], time=time, band=BANDS[n])
        for n, x in seen.items()
    }


@pytest.mark.parametrize("step", [1, 4])
def test_both_bands_tell_cover_and_the_cold_one_tops(step):
    warmer = np.where(KELVIN < 270, KELVIN + 10, KELVIN)
    pair = clouds_of_both(
        _bands(step=step), _bands(kelvin=warmer, step=step), standard_air()
    )
    assert pair is not None
    assert (pair.rule.bright_band, pair.rule.cold_band) == (2, 13)
    assert [seen.cover for _, seen in pair.sides] == [0.75, 0.75]
    assert pair.a.top_k(0.5) == pytest.approx(250, abs=0.01)
    # 230, 250 and 285 K become 240, 260 and 285 K.
    assert pair.b.top_k(0.5) - pair.a.top_k(0.5) == pytest.approx(10, abs=0.01)
    # 6.5 K to a kilometre.
    lower = pair.top_m(pair.a, 0.5) - pair.top_m(pair.b, 0.5)
    assert lower == pytest.approx(10 / 6.5e-3, rel=0.01)


def test_pixels_without_data_in_one_band_do_not_count():
    holes = _bands()
    holes[13].values[:, 3] = np.nan
    pair = clouds_of_both(holes, _bands(), standard_air())
    assert pair is not None
    assert (pair.a.pixels, pair.b.pixels) == (12, 16)
    assert pair.a.cover == pytest.approx(2 / 3)


def test_only_what_is_known_on_both_sides_tells():
    night = SCAN_START + timedelta(hours=12)
    for other in (_bands(time=night), _bands(time=None)):
        pair = clouds_of_both(_bands(), other, standard_air())
        assert pair is not None
        assert (pair.rule.bright_band, pair.rule.cold_band) == (None, 13)
        assert pair.a.cover == 0.5
    unknown = {n: replace(b, band=None) for n, b in _bands().items()}
    assert clouds_of_both(_bands(), unknown, standard_air()) is None


def test_bands_on_unlike_pixels_leave_the_cold_one():
    other = {n: replace(b, grid=None) for n, b in _bands(step=2).items()}
    pair = clouds_of_both(other, other, standard_air())
    assert pair is not None
    assert pair.rule.bright_band is None


def test_a_comparison_tells_cover_in_numbers_that_json_has():
    clear = _bands(bright=0 * BRIGHT, kelvin=0 * KELVIN + 290)
    found = comparison_json(compare(_bands(), clear, ("a", "b")))
    assert found["clouds"]["b"]["cover"] == 0
    assert set(found["clouds"]["b"]["top_k"].values()) == {None}
    assert found["clouds"]["a"]["top_k"]["0.5"] == pytest.approx(250, abs=0.01)
    assert "US standard" in found["clouds"]["heights_by"]
    json.dumps(found, allow_nan=False)


def test_heights_are_the_lowest_that_are_so_cold():
    levels = np.array([0.0, 1e3, 2e3, 3e3, 4e3, 20e3])
    air = AirColumn(levels, np.array([290.0, 280, 285, 270, 260, 300]), "this air")
    expected = {300.0: 0.0, 285.0: 500.0, 275.0: 2500.0, 260.0: 4e3, 200.0: 4e3}
    for kelvin, height in expected.items():
        assert air.height_m(kelvin) == pytest.approx(height), kelvin
    assert np.isnan(air.height_m(np.nan))
