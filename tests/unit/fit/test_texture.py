"""Spectra and increments of images, against closed forms and sums by numpy."""

import numpy as np
import pytest

from cloudjax_fit.band_radiances import BandRadiances
from cloudjax_fit.comparison import compare, comparison_json
from cloudjax_fit.texture import TexturePair, texture


SHAPE = (96, 128)
EVERY = np.ones(SHAPE, bool)
NOISE = np.random.default_rng(4).standard_normal(SHAPE)


def test_white_noise_has_the_same_power_at_every_scale():
    """Each of the N components of noise of variance v has v/N. Tolerance: 4 deviations
    of a mean over the components of an octave."""
    found = texture(3.0 * NOISE, EVERY)
    np.testing.assert_array_equal(found.wavelength, [64, 32, 16, 8, 4])
    components = np.array([12, 48, 192, 768, 3072]) * np.pi / 4
    expected = 9.0 / NOISE.size
    assert np.all(abs(found.power / expected - 1) < 4 / np.sqrt(components / 2))


@pytest.mark.parametrize(
    ("pixels", "octave"), [(48, 64), (24, 32), (12, 16), (6, 8), (3, 4)]
)
@pytest.mark.parametrize("along", [0, 1])
def test_a_wave_has_its_power_in_its_octave(pixels, octave, along):
    wave = np.sin(2 * np.pi * np.indices(SHAPE)[along] / pixels)
    found = texture(100 + wave, EVERY)
    assert found.wavelength[found.power.argmax()] == octave


@pytest.mark.parametrize("pixels", [63, 64])
def test_rows_and_columns_count_alike(pixels):
    """Stripes have as much power however they run: half of the plane stands for all."""
    rows = np.indices((pixels, pixels))[0]
    stripes = np.sin(rows / 2) + 0.3 * NOISE[:pixels, :pixels]
    known = np.ones((pixels, pixels), bool)
    one, other = texture(stripes, known), texture(stripes.T, known)
    np.testing.assert_allclose(one.power, other.power, rtol=1e-4)


def test_increments_are_those_of_all_pairs_in_rows_and_columns():
    counted = NOISE > -0.5
    found = texture(NOISE, EVERY, counted)
    for lag, increment in zip(found.lag.astype(int), found.increment, strict=True):
        pairs = [
            (NOISE[:-lag], NOISE[lag:], counted[:-lag] & counted[lag:]),
            (NOISE[:, :-lag], NOISE[:, lag:], counted[:, :-lag] & counted[:, lag:]),
        ]
        expected = np.concatenate([abs(b - a)[both] for a, b, both in pairs]).mean()
        assert increment == pytest.approx(expected, rel=1e-5)


def test_twice_the_contrast_is_6_db_and_twice_the_increments():
    pair = TexturePair(texture(NOISE, EVERY), texture(7 - 2 * NOISE, EVERY))
    np.testing.assert_allclose(pair.power_ratio_db, 20 * np.log10(2), atol=1e-3)
    np.testing.assert_allclose(pair.increment_ratio, 2, rtol=1e-4)


def test_pixels_without_data_say_nothing():
    known = EVERY.copy()
    known[20:40, 30:80] = False
    holed, filled = np.where(known, NOISE, np.nan), np.where(known, NOISE, 1e6)
    one, other = texture(holed, known), texture(filled, known)
    np.testing.assert_allclose(one.power, other.power)
    np.testing.assert_allclose(one.increment, other.increment)
    assert np.isfinite(one.power).all()


def test_images_without_contrast_have_no_ratio():
    flat = texture(np.full(SHAPE, 5.0), EVERY)
    numbers = TexturePair(flat, texture(NOISE, EVERY)).numbers()
    assert numbers["power_ratio_db"] == [None] * 5
    assert numbers["increment_ratio"] == [None] * 6


def test_a_comparison_of_images_has_their_textures():
    one, other = (BandRadiances(13, "K", k * NOISE) for k in (1.0, 2.0))
    numbers = comparison_json(compare({13: one}, {13: other}, ("a", "b")))
    found = numbers["bands"]["13"]["texture"]
    np.testing.assert_allclose(found["power_ratio_db"], 6.02, atol=0.01)
    pixels = BandRadiances(13, "K", NOISE.ravel())
    numbers = comparison_json(compare({13: one}, {13: pixels}, ("a", "b")))
    assert "texture" not in numbers["bands"]["13"]
