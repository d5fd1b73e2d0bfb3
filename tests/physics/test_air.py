"""Gases and scattering above clouds, against their source and against principles."""

import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import BandRadiances, Rays, StandardAtmosphere, TemperatureProfile
from cloudjax.air.atmosphere import pressure_pa, temperature_k
from cloudjax.air.clear_air import Air, Column
from cloudjax.air.gases import (
    LEVELS_M,
    airmass,
    columns,
    optical_depth,
    standard_depth,
    standard_humidity,
)
from cloudjax.geometry.geodesy import ecef
from tests.helpers import (
    emissive_bands,
    fractal_cloud,
    geostationary_rays,
    layer,
    make_scene,
    numbers,
    rays_to,
    reflective_bands,
    seen_along,
    sun,
)


THERMAL = tuple(range(7, 17))
SUNLIT = (1, 2, 3, 5, 6)
ALL = tuple(range(1, 17))
STANDARD = columns(np.asarray(temperature_k(LEVELS_M)), standard_humidity())
# Warm and moist to the tropopause: 80 % of saturation in the tropics, roughly.
MOIST = columns(
    np.maximum(300 - 6.5e-3 * LEVELS_M, 200.0),
    np.maximum(0.019 * np.exp(-LEVELS_M / 2300), 3e-6),
)


def level(altitude_m: float) -> int:
    return int(np.flatnonzero(altitude_m == LEVELS_M)[0])


def through(bands, above, airmasses=1.0) -> np.ndarray:
    """Transmittance to space, [bands levels]."""
    slant = airmasses * jnp.ones(len(LEVELS_M))
    return np.exp(-np.asarray(optical_depth(bands, above, slant), float))


def test_pressure_is_that_of_the_standard_atmosphere():
    """Geometry: a column to 50 km. Expectation: p(z) as its own module has it.

    Source: US Standard Atmosphere 1976. Tolerance: 0.2 % to 20 km, 1 % to 50 km: steps
    of the integral, and vapour that makes air lighter.
    """
    expected = np.asarray(pressure_pa(LEVELS_M)) / 101325
    error = np.abs(STANDARD.pressure / expected - 1)
    assert error[LEVELS_M <= 20e3].max() < 2e-3
    assert error.max() < 1e-2


def test_precipitable_water_is_that_of_the_us_standard():
    """Geometry: a column. Expectation: 1.42 g/cm², 0.344 atm cm of ozone.

    Source: Anderson et al. (1986, AFGL-TR-86-0110). Tolerance: 2 %.
    """
    assert STANDARD.water[0] == pytest.approx(1.42, rel=0.02)
    assert STANDARD.ozone[0] == pytest.approx(0.344, rel=0.02)


@pytest.mark.parametrize("above", [STANDARD, MOIST], ids=["standard", "moist"])
def test_transmittance_rises_with_altitude_to_one(above):
    """Geometry: straight up and a slant of five airmasses. Expectation: t(z) rises in
    every band, to 1 at 50 km, within what CO2 and ozone leave there.

    Tolerance: 1 % at the top, rounding on the way.
    """
    for slant in (1.0, 5.0):
        t = through(ALL, above, slant)
        assert (np.diff(t, axis=1) >= -1e-6).all()
        assert t[:, -1].min() > 0.99


def test_the_cirrus_band_hides_low_cloud_and_the_vapour_band_the_middle():
    """Geometry: band 4 down and up at 30°, band 8 straight up. Expectation: of cloud at
    1 km band 4 shows less than 2 % in the standard air and less than 1e-4 in moist
    air, of cirrus at 10 km more than 85 %; band 8 sees less than 3 % of what is below
    500 hPa in moist air. Source: the purpose of both bands (Gao et al. 1993, Geophys.
    Res. Lett. 20, 301; Schmit et al. 2017, BAMS 98, 681).
    """
    both = 2 / np.cos(np.radians(30))
    low, high = level(1000.0), level(10_000.0)
    assert through([4], STANDARD, both)[0, low] < 0.02
    assert through([4], MOIST, both)[0, low] < 1e-4
    assert through([4], STANDARD, both)[0, high] > 0.85
    middle = np.flatnonzero(MOIST.pressure * 1013 > 500)[-1]
    assert through([8], MOIST)[0, middle] < 0.03


# LOWTRAN 7 itself, spectrally, from 100 km straight down on the US standard atmosphere
# with 410 ppm of CO2, averaged over each band: brightness in kelvin.
LOWTRAN_K = (
    286.00, 235.94, 243.46, 253.82, 283.51, 262.70, 285.74, 286.46, 284.03, 265.77,
)  # fmt: skip


def _straight_down():
    place = ecef(np.array([10.0]), np.array([20.0]), np.array([0.0]))
    return rays_to(place[0] * 2, place)


def _column(air: Air, rays: Rays, sun_direction: np.ndarray) -> Column:
    return air.look(rays, rays.ground()[0], sun_direction)


def _clear(air, temperature, surface_k: float):
    """Brightness of black ground at sea level, by band."""
    bands = emissive_bands(*THERMAL)
    column = _column(air, _straight_down(), sun(30))
    emission = air.emission(bands, column, temperature)
    ground = bands.planck(numbers(surface_k))
    seen = emission.over(ground, numbers(0.0))
    return np.asarray(bands.brightness_temperature_k(seen))[:, 0]


def test_clear_sky_is_as_bright_as_in_the_source():
    """Geometry: straight down on black ground of 288.2 K under the US standard.

    Expectation: the brightness that LOWTRAN computes with its own layers and spectra.
    Source: LOWTRAN 7, run by itself. Tolerance: 0.7 K in the vapour bands and the ozone
    band, 0.3 K in the others.
    """
    found = _clear(Air.of_bands(THERMAL), StandardAtmosphere(), 288.2)
    error = np.abs(found - np.array(LOWTRAN_K))
    strong = np.isin(THERMAL, (8, 9, 10, 12, 16))
    assert error[strong].max() < 0.7
    assert error[~strong].max() < 0.3


def test_cloud_and_air_of_one_temperature_are_a_black_body():
    """Geometry: broken cloud of any opacity from a slant, ground, air and cloud at
    255 K. Expectation: Planck's function in every band. Source: Kirchhoff's law.
    Tolerance: 2e-5, rounding in float32.
    """
    bands = emissive_bands(*THERMAL)
    same = TemperatureProfile(numbers(0.0, 60e3), numbers(255.0, 255.0))
    air = Air.of_bands(THERMAL)
    scene = make_scene(
        [layer(fractal_cloud(), emissive=len(THERMAL), extinction_per_m=0.001)],
        emissive=bands,
        temperature=same,
        air=air,
    )
    rays = geostationary_rays(12)
    black = bands.planck(numbers(255.0))
    behind = BandRadiances(None, jnp.broadcast_to(black, (len(THERMAL), 12)))
    seen = seen_along(scene, rays, sun(30), behind)
    assert seen.emissive is not None
    assert behind.emissive is not None
    np.testing.assert_allclose(seen.emissive, behind.emissive, rtol=2e-5)


def test_sun_and_viewer_may_swap_above_a_cloud():
    """Geometry: sun at 20° and viewer at 60°, and the other way round. Expectation:
    equal transmittances, equal path reflectance over the sun's cosine. Source:
    reciprocity. Tolerance: rounding.
    """
    bands, air = reflective_bands(*SUNLIT), Air.of_bands(SUNLIT)
    place = ecef(np.array([0.0]), np.array([0.0]), np.array([0.0]))
    views = []
    for view, light in ((60.0, 20.0), (20.0, 60.0)):
        θ = np.radians(view)
        towards = np.array([[np.cos(θ), np.sin(θ), 0.0]])
        rays = rays_to(place[0] + 1e7 * towards[0], place)
        sunlight = sun(light, 0.0, 0.0)
        column = _column(air, rays, sunlight)
        veil = air.veil(bands, column, StandardAtmosphere(), numbers(2000.0))
        views.append((column, veil))
    (there, one), (back, other) = views
    assert float(there.sun[0]) == pytest.approx(float(back.view[0]), rel=1e-5)
    np.testing.assert_allclose(one.passed, other.passed, rtol=1e-5)
    paths = one.path / there.sun[None], other.path / back.sun[None]
    np.testing.assert_allclose(*paths, rtol=1e-5)


def test_white_cloud_stays_white_under_blue_sky():
    """Geometry: a cloud of reflectance 0.7 at 1 km, sun and viewer at 40°. Expectation:
    in band 1 within 5 % of what it is without air, since scattering takes no light
    away; a beam that is only weakened would leave three quarters.
    """
    bands, air = reflective_bands(1), Air.of_bands((1,))
    rays = geostationary_rays(1)
    column = _column(air, rays, sun(40))
    veil = air.veil(bands, column, StandardAtmosphere(), numbers(1000.0))
    cloud = 0.7 * column.sun[None]
    seen = veil.path + veil.over(cloud, column.sun)
    assert float(seen[0, 0]) == pytest.approx(float(cloud[0, 0]), rel=0.05)


def test_what_is_thin_is_left_out():
    """Expectation: Rayleigh scattering in bands 1 to 3 only; no gases where the
    standard air holds less than 0.005 of them.
    """
    air = Air.of_bands(ALL)
    assert air.scattered == (1, 2, 3)
    thick = standard_depth(ALL) > 0.005
    assert air.absorbed == tuple(np.array(ALL)[thick])


def test_slants_are_finite_at_the_horizon():
    """Source: Kasten & Young (1989, Appl. Opt. 28, 4735): 1.994, 5.60, 10.3 at zenith
    angles of 60, 80 and 85 degrees, 38 at the horizon. Tolerance: 2 %, 6 % there.
    """
    angles = np.radians([0, 60, 80, 85, 90])
    expected = [1.0, 1.994, 5.60, 10.31, 37.92]
    found = airmass(np.cos(angles))
    np.testing.assert_allclose(found[:4], expected[:4], rtol=0.02)
    assert found[4] == pytest.approx(expected[4], rel=0.06)
    assert airmass(np.array([-0.5])) == pytest.approx(found[4])
