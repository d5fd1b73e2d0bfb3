"""Spectra of rows of images, of fields whose answers are known."""

import numpy as np
import pytest

from cloudjax import FixedGrid
from cloudjax_fit.validation.seen_earth import pixel_areas_m2
from cloudjax_fit.validation.spectra import finest_part, row_spectrum


def _rows(slope: float, pixel_km: float, rows: int = 40, columns: int = 256):
    """Noise whose power falls with wavenumber by a power law, cut from longer rows so
    that it has no period.
    """
    rng = np.random.default_rng(7)
    k = np.fft.rfftfreq(4 * columns, pixel_km)
    phase = np.exp(2j * np.pi * rng.random((rows, k.size)))
    amplitude = np.concatenate([[0.0], k[1:] ** (slope / 2)])
    return np.fft.irfft(amplitude * phase)[:, :columns]


@pytest.mark.parametrize("slope", [-5 / 3, -3.0, 0.0])
def test_a_power_law_has_its_slope(slope):
    found = row_spectrum(_rows(slope, 10.0), 10.0)
    assert found is not None
    assert found.slope == pytest.approx(slope, abs=0.15)
    assert found.fitted_km == (500.0, 50.0)
    assert (found.rows, found.columns) == (40, 256)


def test_a_wave_has_its_length_and_its_variance():
    """A wave of 120 km and amplitude 2 has variance 2, the integral of its density; a
    plane beneath it has none.
    """
    x = 10.0 * np.arange(300)
    row = 2 * np.cos(2 * np.pi * x / 120) + 0.01 * x
    found = row_spectrum(np.tile(row, (5, 1)), 10.0)
    assert found is not None
    peak = found.wavelength_km[found.power.argmax()]
    assert peak == pytest.approx(120, rel=0.15)
    k = 1 / found.wavelength_km
    assert np.trapezoid(found.power, k) == pytest.approx(2, rel=0.25)
    reference = found.line(-3.0)
    steps = np.diff(np.log(reference)) / np.diff(np.log(k))
    np.testing.assert_allclose(steps, -3.0)


def test_rows_that_are_short_or_broken_have_no_spectrum():
    broken = _rows(-2.0, 10.0)
    broken[3:, 5] = np.nan
    assert row_spectrum(broken, 10.0) is None
    broken[7:, 5] = 0.0
    rest = row_spectrum(broken, 10.0)
    assert rest is not None
    assert rest.rows == 36
    assert row_spectrum(np.ones((40, 20)), 10.0) is None
    short = row_spectrum(_rows(-2.0, 40.0, columns=32), 40.0)
    assert short is not None
    assert short.fitted_km == (320.0, 120.0)


def test_spectra_are_of_the_middle_of_a_disc():
    """A pixel grows by 1.25 along the row 30 degrees of the Earth from the middle, and
    the part is the same on all sides.
    """
    angles = np.linspace(-0.15, 0.15, 241)
    grid = FixedGrid(angles, -angles, -75.0)
    ground, hit = grid.rays().ground()
    latitude, longitude = (
        np.where(hit, x, np.nan).reshape(grid.shape)
        for x in (ground.latitude_deg, ground.longitude_deg)
    )
    part = finest_part(latitude, longitude, pixel_areas_m2(latitude, longitude))
    assert part is not None
    assert part.rows.start + part.rows.stop == pytest.approx(241, abs=2)
    assert part.columns.start + part.columns.stop == pytest.approx(241, abs=2)
    edge = np.abs(longitude[120, part.columns] + 75).max()
    assert edge == pytest.approx(29, abs=3)
    assert part.pixel_km == pytest.approx(0.3 / 240 * 35786 * 1.08, rel=0.05)
