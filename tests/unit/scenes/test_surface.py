"""The ground: known places, snow, and temperatures from the weather."""

from datetime import UTC, datetime

import numpy as np
import pytest

from cloudjax.geometry.geodesy import up
from cloudjax.geometry.rays import Rays
from cloudjax_data import read_weather
from cloudjax_scenes.ground_cover import SEA, SNOW
from cloudjax_scenes.surface import Surface
from tests.generated import write_grib


LAND = {
    "Sahara": (23.0, 10.0),
    "Amazon": (-5.0, -65.0),
    "Siberia": (62.0, 100.0),
    "Kansas": (38.5, -98.0),
    "South Pole": (-89.0, 0.0),
    "Chukotka, beyond the date line": (67.0, -175.5),
}
WATER = {
    "Pacific": (0.0, -140.0),
    "Atlantic": (30.0, -40.0),
    "Indian Ocean": (-30.0, 80.0),
    "Gulf of Mexico": (25.0, -90.0),
    "at the date line": (10.0, 180.0),
    "North Pole": (90.0, 0.0),
}
LATITUDE = np.arange(90.0, -91.0, -30.0)
LONGITUDE = np.arange(0.0, 360.0, 30.0)
SHAPE = (LATITUDE.size, LONGITUDE.size)


def at(*places):
    latitude, longitude = np.array(places, float).T
    return latitude, longitude


def weather(folder, **ground):
    """Air of 280 K at 110 m, 270 K at 1500 m and 240 K at 5600 m."""
    layers = {1000: (110.0, 280.0), 850: (1500.0, 270.0), 500: (5600.0, 240.0)}
    fields = {}
    for level, (z, t) in layers.items():
        values = {"gh": z, "t": t, "u": 1.0, "v": 1.0, "w": 0.0, "r": 50.0}
        fields |= {(name, level): np.full(SHAPE, x) for name, x in values.items()}
    fields |= {(name, 0): np.full(SHAPE, x) for name, x in ground.items()}
    return read_weather(
        write_grib(
            folder / "gfs.grib",
            fields,
            latitude_deg=LATITUDE,
            longitude_deg=LONGITUDE,
            time=datetime(2019, 10, 27, 18, tzinfo=UTC),
        )
    )


def test_known_places_are_land_or_sea():
    assert Surface.of().land_at(*at(*LAND.values())) == pytest.approx(1.0)
    assert Surface.of().land_at(*at(*WATER.values())) == pytest.approx(0.0)


def test_the_share_of_land_is_that_of_the_earth():
    """29.2 % of the sphere; lakes, 0.5 % to 1 % of it, count as land."""
    φ, λ = np.meshgrid(np.arange(-89.75, 90, 0.5), np.arange(-179.75, 180, 0.5))
    share = Surface.of().land_at(φ.ravel(), λ.ravel())
    weight = np.cos(np.radians(φ.ravel()))
    assert np.average(share, weights=weight) == pytest.approx(0.292, abs=0.01)


def test_a_coast_lies_where_it_is():
    """Pedernales, Ecuador, 0.07 N 80.05 W; the middle of the change within 0.1 deg."""
    longitude = np.linspace(-80.6, -79.6, 201)
    share = Surface.of().land_at(np.full(201, 0.07), longitude)
    assert share[0] == 0
    assert share[-1] == 1
    assert longitude[np.argmax(share > 0.5)] == pytest.approx(-80.05, abs=0.1)


def test_reflectances_of_sea_and_land():
    cover = Surface.of().cover(*at(WATER["Pacific"], LAND["Kansas"]))
    found = cover.reflectance([3, 1, 6])
    assert found.shape == (3, 2)
    np.testing.assert_allclose(found[:, 0], [SEA[2], SEA[0], SEA[5]])
    # Land is brighter, most of all in the near infrared.
    assert np.all(found[:, 1] > found[:, 0])
    assert found[0, 1] > 0.2 > 0.1 > found[1, 1]
    assert np.all((found > 0) & (found < 1))


@pytest.mark.parametrize(
    ("skin_k", "snow"), [(300.0, 0.0), (271.0, 0.0), (265.0, 0.5), (250.0, 1.0)]
)
def test_cold_ground_and_sea_are_white(tmp_path, skin_k, snow):
    places = at(WATER["North Pole"], WATER["Pacific"])
    cold = Surface.of(weather(tmp_path, t=skin_k)).cover(*places)
    np.testing.assert_allclose(cold.temperature_k, skin_k, rtol=1e-4)
    expected = snow * SNOW[1] + (1 - snow) * SEA[1]
    found = cold.reflectance([2])
    np.testing.assert_allclose(found, expected, atol=2e-3)


def test_forests_hide_snow(tmp_path):
    """0.3 to 0.4 in the visible, 0.8 in the open (Moody et al. 2007)."""
    cold = Surface.of(weather(tmp_path, t=250.0)).cover(*at((0.0, 22.0), (48.0, 68.0)))
    forest, steppe = cold.reflectance([2])[0]
    assert 0.3 < forest < 0.4
    assert steppe == pytest.approx(SNOW[1])
    # Snow is black in the infrared, and what it covers is hidden.
    np.testing.assert_allclose(cold.emissivity([11]), 1)


def test_between_two_times_the_skin_is_between(tmp_path):
    (tmp_path / "later").mkdir()
    night, day = (
        Surface.of(weather(folder, t=skin_k))
        for folder, skin_k in ((tmp_path, 290.0), (tmp_path / "later", 310.0))
    )
    found = night.towards(day, 0.25).cover(*at(LAND["Sahara"]))
    np.testing.assert_allclose(found.temperature_k, 295.0, rtol=1e-4)


@pytest.mark.parametrize(
    ("ground_m", "expected_k"),
    [(0.0, 280 + 0.715), (500.0, 270 + 6.5), (3000.0, 240 + 16.9)],
)
def test_without_a_skin_the_lowest_air_above_ground_counts(
    tmp_path, ground_m, expected_k
):
    surface = Surface.of(weather(tmp_path, orog=ground_m))
    found = surface.cover(*at((45.0, 200.0), (-10.0, -77.0)))
    np.testing.assert_allclose(found.temperature_k, expected_k, atol=0.01)


def test_without_weather_the_standard_temperature():
    cover = Surface.of().cover(*at((0, 0)))
    np.testing.assert_array_equal(cover.temperature_k, 288.15)


def test_what_is_not_reflected_at_4_micrometres_is_emitted():
    cover = Surface.of().cover(*at((0.0, -140.0), (23.0, 10.0), (-89.0, 0.0)))
    (albedo,) = cover.reflectance([7])
    assert albedo[0] == pytest.approx(SEA[6])
    assert 0.2 < albedo[1] < 0.3
    np.testing.assert_allclose(cover.emissivity([7])[0], 1 - albedo)


def _glint(surface, *places):
    """In band 2, seen from straight above with the sun overhead there."""
    latitude, longitude = at(*places)
    vertical = up(latitude, longitude)
    rays = Rays(7e6 * vertical, -vertical, 1e-5)
    cover = surface.cover(latitude, longitude)
    return np.array(
        [
            cover.glint([2], rays, vertical, sun_direction)[0, i]
            for i, sun_direction in enumerate(vertical)
        ]
    )


def test_water_mirrors_the_sun_as_the_wind_tells_and_land_and_ice_do_not(tmp_path):
    """The factor is ρ/(4 σ²), of the wind at 10 m: that of the lowest air, at 110 m,
    times ln(10/z)/ln(110/z), z = 0.2 mm.
    """
    places = WATER["Pacific"], LAND["Sahara"], WATER["North Pole"]
    windy = weather(tmp_path, t=np.where(LATITUDE[:, None] > 80, 250.0, 290.0))
    fresnel = (0.331 / 2.331) ** 2
    wind = np.sqrt(2) * np.log(10 / 2e-4) / np.log(110 / 2e-4)
    for surface, speed in ((Surface.of(windy), wind), (Surface.of(), 6.6)):
        water, land, ice = _glint(surface, *places)
        assert water == pytest.approx(fresnel / (4 * (0.003 + 0.00512 * speed)), 0.01)
        assert land == 0
        assert (ice == 0) == (speed == wind)
