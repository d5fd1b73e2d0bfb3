"""What two images are compared in: the pixels that both have."""

from dataclasses import replace

import numpy as np
import pytest
from tests.generated import window

from cloudjax import FixedGrid
from cloudjax_data import DataError
from cloudjax_fit.band_radiances import BandRadiances
from cloudjax_fit.common_pixels import common_pixels
from cloudjax_fit.comparison import compare


UNITS = "mW m-2 sr-1 (cm-1)-1"


def _images():
    rng = np.random.default_rng(0)
    a, b = rng.uniform(20, 100, (2, 8, 8))
    a[:, :4] = np.nan
    b[6:] = np.nan
    return a, b


def test_both_are_compared_where_both_are():
    a, b = _images()
    grid = window((8, 8))
    one, other = (BandRadiances(13, UNITS, x, grid=grid) for x in (a, b))
    result = compare({13: one}, {13: other}, ("a", "b"))
    both = np.isfinite(a) & np.isfinite(b)
    found = result.bands[0].distances
    assert (found.n_observed, found.n_simulated) == (both.sum(), both.sum())
    assert found.bias == pytest.approx(b[both].mean() - a[both].mean())
    share = 1 - both.sum() / 48
    assert result.warnings == [
        f"{share:.1%} of the pixels of band 13 are in one of the two only, and are "
        "left out."
    ]


def test_pixels_that_are_averaged_are_not_called_left_out():
    fine, coarse = window((8, 8), 2.8e-5), window((4, 4), 5.6e-5)
    one = BandRadiances(13, UNITS, np.arange(64.0).reshape(8, 8), grid=fine)
    other = BandRadiances(13, UNITS, np.arange(16.0).reshape(4, 4), grid=coarse)
    assert compare({13: one}, {13: other}, ("a", "b")).warnings == []


def test_fine_pixels_are_averaged_and_all_of_them_must_be_there():
    fine, coarse = window((8, 8), 2.8e-5), window((4, 4), 5.6e-5)
    a, b = np.arange(64.0).reshape(8, 8), np.ones((4, 4))
    a[1, 1] = a[5, 5] = b[3, 0] = np.nan
    kept = np.ones((4, 4), bool)
    kept[0, 0] = kept[2, 2] = kept[3, 0] = False
    means = np.where(kept, a.reshape(4, 2, 4, 2).mean((1, 3)), np.nan)
    expected = {True: means, False: np.where(kept, b, np.nan)}
    for first, grid, second, other in ((a, fine, b, coarse), (b, coarse, a, fine)):
        both = common_pixels(first, grid, second, other)
        assert both is not None
        for found, image in zip(both, (first, second), strict=True):
            np.testing.assert_array_equal(found, expected[image is a])


@pytest.mark.parametrize(
    "other",
    [
        window((8, 8), west_edge_rad=0.02464 + 5.6e-5),
        window((8, 9)),
        window((8, 8), subsatellite_longitude_deg=-75.0),
    ],
)
def test_other_areas_are_compared_in_full(other: FixedGrid):
    a, b = _images()
    b = np.resize(b, other.shape)
    assert common_pixels(a, window((8, 8)), b, other) is None
    one = BandRadiances(13, UNITS, a, grid=window((8, 8)))
    two = BandRadiances(13, UNITS, b, grid=other)
    found = compare({13: one}, {13: two}, ("a", "b")).bands[0].distances
    assert found.n_observed == np.isfinite(a).sum()


def test_images_from_the_south_are_the_same_area():
    grid = window((8, 8))
    turned = replace(grid, y_rad=grid.y_rad[::-1].copy())
    a, b = _images()
    both = common_pixels(a, grid, b[::-1], turned)
    assert both is not None
    known = np.isfinite(a) & np.isfinite(b)
    for found, image in zip(both, (a, b), strict=True):
        expected = np.where(known, image, np.nan)
        np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_nothing_in_common_is_said():
    a, b = _images()
    b[:, 4:] = np.nan
    grid = window((8, 8))
    one, two = (BandRadiances(13, UNITS, x, grid=grid) for x in (a, b))
    with pytest.raises(DataError, match="no valid pixel in band 13"):
        compare({13: one}, {13: two}, ("a", "b"))
