"""What is taken to lie below clouds that leave no pixel clear."""

from dataclasses import replace
from datetime import timedelta

import numpy as np
import pytest

from cloudjax_data import DataError, open_folder, read_weather
from cloudjax_scenes.ground_cover import SEA
from cloudjax_scenes.imagery_reduction import reduce_scene
from tests.generated import (
    DIALECT,
    EARTH_SUN_DISTANCE_AU,
    SCAN_START,
    default_calibration,
    window,
    write_abi_l1b,
)
from tests.scenes import NIGHT, SHAPE, write_weather


# West of Mexico: no land within a thousand kilometres.
AT_SEA = {"west_edge_rad": 0.02464, "north_edge_rad": 0.05}


def overcast(folder, bands, start=NIGHT, kelvin=240.0, **edges):
    folder.mkdir(exist_ok=True)
    for band in bands:
        seen = kelvin if band >= 7 else 0.7
        radiance = default_calibration(band).radiance(np.full(SHAPE, seen))
        grid = window(SHAPE, **(AT_SEA | edges))
        write_abi_l1b(folder, band=band, radiance=radiance, grid=grid, start=start)
    return open_folder(folder).read()


def planck(band: int, kelvin: float) -> float:
    fk1, fk2, bc1, bc2 = DIALECT[band].coefficients
    return fk1 / (np.exp(fk2 / (bc1 + bc2 * kelvin)) - 1)


def kappa0(band: int) -> float:
    (esun,) = DIALECT[band].coefficients
    return np.pi * EARTH_SUN_DISTANCE_AU**2 / esun


def test_by_night_it_is_as_warm_as_the_standard_atmosphere(tmp_path):
    imagery = reduce_scene(overcast(tmp_path / "scene", (13, 15))).imagery
    for band in (13, 15):
        expected = planck(band, 288.15)
        np.testing.assert_allclose(
            imagery.background.radiance[band], expected, rtol=1e-5
        )
    (said,) = imagery.notes
    assert said.startswith("No pixel is clear: the ground is that of the table")
    assert "288.15 K of the standard atmosphere" in said


def test_it_is_as_warm_as_the_weather_says(tmp_path):
    """Air of 270 K at 110 m, brought down by 6.5 K/km."""
    cube = read_weather(write_weather(tmp_path, NIGHT - timedelta(hours=1)))
    scene = overcast(tmp_path / "scene", (13,))
    imagery = reduce_scene(scene, weather=cube).imagery
    np.testing.assert_allclose(
        imagery.background.radiance[13], planck(13, 270.0 + 0.0065 * 110), rtol=1e-4
    )
    assert "the temperature in gfs.grib2" in imagery.notes[0]


def test_by_day_it_is_as_bright_as_the_table(tmp_path):
    """The albedo of the sea times the cosine of the sun's zenith angle, 40 degrees by
    an almanac, and in blue the air's own light, of some 0.09."""
    scene = overcast(tmp_path / "scene", (3, 5, 13), SCAN_START)
    imagery = reduce_scene(scene).imagery
    for band in (3, 5):
        factor = imagery.background.radiance[band] * kappa0(band)
        air = {3: 0.0075, 5: 0.0006}[band]
        expected = SEA[band - 1] * np.cos(np.radians(40)) + air
        np.testing.assert_allclose(factor.mean(), expected, rtol=0.15)


def test_land_is_that_of_the_table(tmp_path):
    """The desert and the fields of California, by day: an albedo of 0.25 to 0.35 at
    0.87 µm by MODIS (Moody et al. 2005)."""
    edges = {"west_edge_rad": 0.0434, "north_edge_rad": 0.0966}
    scene = overcast(tmp_path / "scene", (3,), SCAN_START, **edges)
    imagery = reduce_scene(scene).imagery
    factor = np.median(imagery.background.radiance[3]) * kappa0(3)
    assert factor == pytest.approx(0.3 * np.cos(np.radians(47)) + 0.0075, rel=0.15)


@pytest.mark.parametrize("band", [8, 12, 16])
def test_what_the_air_hides_is_refused(tmp_path, band):
    scene = overcast(tmp_path / "scene", (band, 13))
    with pytest.raises(DataError, match=f"below its clouds in band {band}, where"):
        reduce_scene(scene)


def test_one_clear_corner_is_believed(tmp_path):
    scene = overcast(tmp_path / "scene", (13,))
    band = scene.bands[13]
    warm = band.radiance.copy()
    warm[:4, :4] = planck(13, 295.0)
    scene = replace(scene, bands={13: replace(band, radiance=warm)})
    imagery = reduce_scene(scene).imagery
    np.testing.assert_allclose(
        imagery.background.radiance[13], planck(13, 295.0), rtol=1e-5
    )
    assert imagery.notes == ()
