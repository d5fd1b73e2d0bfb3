"""The ground below weather is seen through the air, that of imagery is not."""

from dataclasses import replace

import numpy as np
import pytest

from cloudjax import Scene, look, nominal_bands, radiances
from cloudjax.geometry.geodesy import up
from cloudjax_data import WeatherSeries, read_weather, sun_direction
from cloudjax_scenes import LIGHTS, SceneFromImagery
from cloudjax_scenes.ground_cover import SEA
from cloudjax_scenes.weather_scene import World
from tests.generated import (
    EARTH_SUN_DISTANCE_AU,
    SCAN_START,
    window,
)
from tests.generated_grib import write_grib
from tests.helpers import PLANCK
from tests.scenes import LEVELS
from tests.small_fits import small_class, small_imagery


BANDS = nominal_bands()
GRID = window((3, 3))
SKIN_K, AIR_K = 300.0, 250.0
# Of the standard air straight up: Bodhaine et al. (1999) at 0.47 µm.
RAYLEIGH = 0.1855


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    """A sea of 300 K below cold air of 250 K, dry as bone."""
    latitude, longitude = np.arange(90.0, -91.0, -30.0), np.arange(0.0, 360.0, 30.0)
    shape = latitude.size, longitude.size
    values = {"u": 0.0, "v": 0.0, "w": 0.0, "r": 0.0, "t": AIR_K}
    fields = {
        (name, level): np.full(shape, value)
        for level, height in LEVELS.items()
        for name, value in (values | {"gh": height}).items()
    } | {("t", 0): np.full(shape, SKIN_K)}
    file = write_grib(
        tmp_path_factory.mktemp("weather") / "gfs.grib2",
        fields,
        latitude_deg=latitude,
        longitude_deg=longitude,
        time=SCAN_START,
    )
    series = WeatherSeries.of([read_weather(file)])
    return World(series, {"low": small_class()}, steps=2)


def _clear(scene: Scene, number: int) -> np.ndarray:
    """The radiance of a band without the clouds."""
    bare = replace(scene, layers=())
    view = look(bare, GRID, sun_direction(SCAN_START))
    return np.asarray(bare.total(radiances(bare, view))[bare.bands.index(number)])


def _cosines():
    """Of the zenith angles of sun and view, and of the angle of scattering."""
    ground, _ = GRID.rays().ground()
    vertical = up(ground.latitude_deg, ground.longitude_deg)
    towards, sun = -GRID.rays().direction, sun_direction(SCAN_START)
    return (
        vertical @ sun,
        (vertical * towards).sum(-1),
        -(towards @ sun),
    )


def test_blue_light_of_the_sky_lies_over_a_dark_sea(world):
    """Single scattering of molecules, and what of the sea comes through.

    Tolerance: up to a quarter more, for light that is scattered twice.
    """
    band = BANDS[1]
    sun, view, scattering = _cosines()
    # A plane layer, whose light is dimmed on its way down and up.
    slant = 1 / sun + 1 / view
    phase = 0.75 * (1 + scattering**2)
    sky = phase / (4 * (sun + view)) * (1 - np.exp(-RAYLEIGH * slant)) * sun
    sea = SEA[0] * sun * np.exp(-RAYLEIGH * slant / 2)
    coefficients = band.coefficients(EARTH_SUN_DISTANCE_AU)
    seen = _clear(world.scene([band], SCAN_START), 1) * coefficients["kappa0"]
    assert ((seen > sky + sea) & (seen < 1.25 * (sky + sea))).all()
    airless = replace(world, air=False)
    bare = _clear(airless.scene([band], SCAN_START), 1) * coefficients["kappa0"]
    np.testing.assert_allclose(bare, SEA[0] * sun, rtol=0.01)
    assert (seen > 1.8 * bare).all()


def test_carbon_dioxide_hides_a_warm_sea(world):
    """Beer-Lambert: of the 50 K between sea and air the column leaves exp(-τ/μ).

    At 13.3 µm carbon dioxide alone takes most of it: what is seen lies between the air
    and the sea.
    """
    band = BANDS[16]
    seen, bare = (
        _kelvin(_clear(made.scene([band], SCAN_START), 16))
        for made in (world, replace(world, air=False))
    )
    np.testing.assert_allclose(bare, SKIN_K, atol=1.0)
    assert ((seen > AIR_K + 3) & (seen < SKIN_K - 10)).all()


def _kelvin(radiance):
    fk1, fk2, bc1, bc2 = PLANCK[16]
    return (fk2 / np.log1p(fk1 / radiance.astype(float)) - bc1) / bc2


@pytest.mark.parametrize("light", LIGHTS.values(), ids=list(LIGHTS))
def test_clear_sky_of_imagery_is_what_was_seen(light):
    """Clear pixels have been seen through the air: it must not be put there twice."""
    imagery = small_imagery()
    made_of = SceneFromImagery(imagery, None, light, {"low": small_class()}, steps=2)
    scene = replace(made_of.build(), layers=())
    view = look(scene, imagery.grid, sun_direction(imagery.time))
    seen = np.asarray(scene.total(radiances(scene, view)))
    for row, number in zip(seen, scene.bands, strict=True):
        expected = imagery.background.radiance[number][0, 0]
        np.testing.assert_allclose(row, expected, rtol=1e-4)
