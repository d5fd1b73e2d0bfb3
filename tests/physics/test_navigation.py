"""Clouds stand where they stand, whoever looks: navigation through whole scenes."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import FixedGrid, Rays
from cloudjax.clouds.ladder import frames
from cloudjax.geometry.geodesy import ecef, up
from cloudjax.geometry.shells import chords
from tests.helpers import LOW_SHELL, fractal_cloud, rays_to, sampling, with_pixels


CLOUD = fractal_cloud(LOW_SHELL)
TEXTURES = CLOUD.make_textures()
RUNGS = len(CLOUD.rungs)
STEPS = 8
FRAMES, SHIFTS = (part.astype(float) for part in frames(CLOUD.ladders, CLOUD.seed))


@eqx.filter_jit
def _sampled(way):
    samples = CLOUD.sample(way, TEXTURES, steps=STEPS, slopes=False)
    altitude = samples.path.altitude_m(samples.path.distance_m(STEPS))
    # Of each rung alone.
    return altitude, tuple(
        samples.fractal(jnp.eye(RUNGS)[i], STEPS) for i in range(RUNGS)
    )


def _navigate(rays: Rays):
    return CLOUD.navigate(with_pixels(rays, 0.0), chords(rays, LOW_SHELL), sampling())


def _middles(rays: Rays):
    """Altitude and texture values at the middle of each step, [rays steps]."""
    altitude, values = _sampled(_navigate(rays))
    return np.asarray(altitude), np.stack([np.asarray(v) for v in values])


@pytest.mark.parametrize("longitude", [0.0, 100.0, 180.0, -75.0])
@pytest.mark.parametrize("latitude", [0.0, 45.0, -89.99, 90.0])
def test_every_sensor_sees_the_same_cloud(latitude, longitude):
    """Geometry: a vertical line of sight, down from 700 km and up from the ground.

    Expectation: the same altitudes and textures in opposite order, also at the poles
    and on the date line. Source: textures are anchored to the Earth. Tolerance: 5 cm
    and 1e-3 of a standard deviation, float32.
    """
    place = np.array([latitude]), np.array([longitude])
    normal = up(*place)
    seen = [
        _middles(Rays(ecef(*place, np.array([height])), way, 1e-4))
        for height, way in ((7e5, -normal), (0.0, normal))
    ]
    np.testing.assert_allclose(seen[0][0], seen[1][0][:, ::-1], atol=0.05)
    np.testing.assert_allclose(seen[0][1], seen[1][1][..., ::-1], atol=1e-3)
    assert np.ptp(seen[0][1]) > 1e-3


def test_two_satellites_meet_at_the_same_place():
    """Geometry: one point at 2.25 km, seen from 75 W and from 137 W.

    Expectation: both rays have its altitude and its place in the textures there.
    Source: the position itself, in float64. Tolerance: 2 cm of altitude, 2e-6 of a
    period, a few centimetres.
    """
    target = ecef(np.array([35.0]), np.array([-106.0]), np.array([2250.0]))
    for longitude in (-75.0, -137.0):
        zero = np.zeros(2)
        satellite = FixedGrid(zero, zero, longitude).satellite_m
        rays = rays_to(satellite, target)
        way = _navigate(rays)
        distance = np.linalg.norm(target - satellite) - float(
            chords(rays, LOW_SHELL).entry_m[0]
        )
        fraction = distance / float(way.path.length_m[0])
        altitude = way.path.altitude_m(jnp.full((1, 1), distance))
        assert float(altitude[0, 0]) == pytest.approx(2250, abs=0.02)
        along = FRAMES @ np.asarray(way.change_m, float)[0, 0, :, 0]
        place = np.asarray(way.entry, float)[0] + fraction * along
        expected = FRAMES @ target[0] + SHIFTS
        off = (np.asarray(place) - expected + 0.5) % 1 - 0.5
        np.testing.assert_allclose(off, 0, atol=2e-6)


def test_there_is_no_seam_at_the_date_line_nor_at_the_pole():
    """Geometry: pairs of vertical rays 2 m apart across the date line and the pole.

    Expectation: textures that differ by no more than their slopes allow.
    Source: textures live in Earth-fixed space, without a chart. Tolerance: 0.02.
    """
    east = 1e-5
    places = [
        (np.array([10.0, 10.0]), np.array([180 - east, -180 + east])),
        (np.array([90 - east, 90 - east]), np.array([0.0, 180.0])),
        (np.array([-90 + east, -90 + east]), np.array([33.0, -147.0])),
    ]
    for latitude, longitude in places:
        normal = up(latitude, longitude)
        rays = Rays(ecef(latitude, longitude, np.full(2, 7e5)), -normal, 1e-4)
        values = _middles(rays)[1]
        np.testing.assert_allclose(values[:, 0], values[:, 1], atol=0.02)


def test_texture_positions_keep_their_precision_on_the_device():
    """Geometry: a grid of rays from geostationary orbit, all across the disc.

    Expectation: entry positions in periods equal those in float64, modulo 1.
    Source: they are reduced before they are rounded. Tolerance: 1e-7 of a period,
    4 mm of 40 km, where float32 ECEF positions alone are off by half a metre.
    """
    angle = np.linspace(-0.14, 0.14, 15)
    rays = FixedGrid(angle, angle, 0.0).rays()
    chord = chords(rays, LOW_SHELL)
    way = _navigate(rays)
    exact = np.einsum("oab,rb->roa", FRAMES, rays.at(chord.entry_m)) + SHIFTS
    off = (np.asarray(way.entry, float) - exact + 0.5) % 1 - 0.5
    np.testing.assert_allclose(off, 0, atol=1e-7)
