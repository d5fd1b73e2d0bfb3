"""What the ground is by place: known deserts, forests, ice and lakes."""

import numpy as np
import pytest

from cloudjax import LatLonGrid
from cloudjax_scenes.ground_cover import (
    FOREST,
    HERBS,
    SAND,
    SEA,
    SNOW,
    SOIL,
    GroundCover,
    ground_cover,
)


def at(*places):
    latitude, longitude = np.array(places, float).T
    return ground_cover().at(latitude, longitude)


def everywhere(step_deg: float):
    """All over the globe, with the weights of areas."""
    φ, λ = np.meshgrid(
        np.arange(-90 + step_deg / 2, 90, step_deg),
        np.arange(-180 + step_deg / 2, 180, step_deg),
    )
    return ground_cover().at(φ.ravel(), λ.ravel()), np.cos(np.radians(φ.ravel()))


@pytest.mark.parametrize(
    ("place", "blue", "red", "near"),
    [
        # Libya 4 and Sudan 1, sites that satellites are calibrated by.
        ((28.55, 23.39), 0.24, 0.44, 0.56),
        ((21.74, 28.22), 0.24, 0.42, 0.54),
        # Forest of the Amazon and of the Congo.
        ((-5.0, -65.0), 0.02, 0.03, 0.30),
        ((-1.0, 22.0), 0.02, 0.03, 0.30),
        # Fields of Iowa and the steppe of Kazakhstan.
        ((42.0, -93.5), 0.04, 0.08, 0.27),
        ((48.0, 68.0), 0.09, 0.16, 0.27),
        # The Gobi.
        ((43.0, 105.0), 0.11, 0.20, 0.28),
    ],
)
def test_known_places_are_as_bright_as_modis_has_them(place, blue, red, near):
    """White-sky albedo at 0.47, 0.65 and 0.86 µm to a digit or two, as in maps of Moody
    et al. (2005) and over sites of sand by Cosnefroy et al. (1996).

    Tolerance: 0.02 or a fifth, of the red that the picture tells.
    """
    found = at(place).reflectance([1, 2, 3])[:, 0]
    np.testing.assert_allclose(found, [blue, red, near], rtol=0.2, atol=0.02)


@pytest.mark.parametrize(
    "place",
    [(47.7, -88.0), (-1.0, 33.0), (53.5, 108.0), (41.0, 51.0), (61.0, 31.5)],
    ids=["Superior", "Victoria", "Baikal", "Caspian", "Ladoga"],
)
def test_lakes_are_water(place):
    lake = at(place)
    assert lake.land == 1
    assert lake.water == pytest.approx(1.0)
    np.testing.assert_allclose(lake.reflectance([1, 3])[:, 0], [SEA[0], SEA[2]])


@pytest.mark.parametrize(
    "place",
    [(-90.0, 0.0), (-89.95, -179.0), (-75.0, 123.0), (72.0, -38.0), (64.4, -16.8)],
    ids=["South Pole", "beside it", "Dome C", "Greenland", "Vatnajökull"],
)
def test_ice_sheets_are_white_in_any_weather(place):
    found = at(place).reflectance([2, 5])[:, 0]
    np.testing.assert_allclose(found, [SNOW[1], SNOW[4]], atol=0.05)


def test_shares_are_of_all():
    ground, _ = everywhere(0.7)
    assert ground.shares.min() > -1e-6
    np.testing.assert_allclose(ground.shares.sum(0), 1, atol=1e-6)
    assert ground_cover().kinds.sum(0).max() == pytest.approx(1)


def test_the_land_of_the_earth_is_as_bright_as_measured():
    """Land without ice and snow has an albedo of some 0.1 in the visible, 0.3 in the
    near infrared and 0.2 in all, in MODIS (Moody et al. 2005). Half of sunlight at the
    ground is of either part. Tolerance: a quarter of that.
    """
    ground, area = everywhere(0.5)
    weight = area * (ground.shares[4] == 0) * (ground.land == 1)
    mean = ground.reflectance([1, 2, 3, 5, 6]) @ weight / weight.sum()
    visible = mean[:2].mean()
    # Between the bands as sunlight is.
    infrared = mean[2:] @ [0.6, 0.3, 0.1]
    assert visible == pytest.approx(0.1, rel=0.25)
    assert infrared == pytest.approx(0.3, rel=0.25)
    assert (visible + infrared) / 2 == pytest.approx(0.2, rel=0.25)


def test_shares_of_the_land_of_the_earth():
    """Ice sheets and glaciers are a tenth of all land, lakes 1 to 2 % of it (Messager
    et al. 2016, Nature Commun. 7, 13603: 1.8 % with the small ones)."""
    ground, area = everywhere(0.5)
    water, forest, _, sand, ice, _ = ground.shares @ area / (ground.land @ area)
    lakes = water - (1 - ground.land) @ area / (ground.land @ area)
    assert lakes == pytest.approx(0.014, abs=0.006)
    assert ice == pytest.approx(0.10, abs=0.02)
    assert forest == pytest.approx(0.25, abs=0.06)
    assert sand == pytest.approx(0.15, abs=0.05)


def test_quartz_of_deserts_emits_less_at_8_micrometres():
    """0.7 to 0.85 at 8.4 µm over the Sahara and 0.9 to 0.96 at 10.3 µm; forest above
    0.96 (Seemann et al. 2008)."""
    sahara, amazon = (23.0, 10.0), (-5.0, -65.0)
    silica, window, long = at(sahara, amazon, (0.0, -140.0)).emissivity([11, 13, 15])
    assert 0.7 < silica[0] < 0.85
    assert 0.9 < window[0] < 0.96
    assert window[0] < long[0] < 1
    np.testing.assert_allclose(silica[1:], 1)


@pytest.mark.parametrize("latitude_deg", [67.5, -16.85], ids=["Chukotka", "Taveuni"])
def test_nothing_breaks_at_the_date_line(latitude_deg):
    """Cells end there; over a thousandth of a degree shares change by 0.02 at most."""
    near = at(*((latitude_deg, λ) for λ in (179.999, 180.0, -180.0, -179.999)))
    assert near.land.max() > 0.2
    shares = near.shares.T
    np.testing.assert_allclose(shares[1], shares[2], atol=1e-9)
    np.testing.assert_allclose(shares[0], shares[3], atol=0.02)


def test_cells_on_both_sides_of_the_date_line_are_neighbours():
    """Lakes in the last cells before it: half of them are left on the line itself."""
    grid = LatLonGrid.from_axes(np.arange(-85.0, 90, 10), np.arange(-175.0, 180, 10))
    kinds = np.zeros((5, *grid.shape), np.float32)
    kinds[0, :, -1] = 1
    cover = GroundCover(np.ones(grid.shape, np.float32), grid, kinds, grid)
    found = cover.at(np.zeros(4), np.array([175.0, 180.0, -180.0, -175.0]))
    np.testing.assert_allclose(found.water, [1, 0.5, 0.5, 0], atol=1e-6)


def test_spectra_go_the_way_that_their_kinds_do():
    """Plants are bright beyond 0.7 µm, bare ground ever more up to 1.6 µm, and snow is
    dark there."""
    for plants in (FOREST, HERBS):
        assert plants[2] > 4 * plants[1] > plants[0]
    for bare in (SOIL, SAND):
        assert all(np.diff(bare[:5]) > 0)
    assert SNOW[4] < 0.2 < SNOW[1]
