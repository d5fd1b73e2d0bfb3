"""Thermal radiation of clouds that scatter, against DISORT and exact limits."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import EmittingSlabs, PlaneParallel, Shell, TemperatureProfile, ice, water
from cloudjax.light.optics import effective_share
from cloudjax.light.reflection import Scatterers
from tests.helpers import (
    emissive_bands,
    fractal_cloud,
    geostationary_rays,
    layer,
    make_background,
    make_scene,
    numbers,
    seen_along,
    sun,
)


SLABS = EmittingSlabs(PlaneParallel.load())
BANDS = (7, 8, 9, 10, 11, 12, 13, 14, 15, 16)
STREAMS = 32


def particles_in(made, band: int) -> Scatterers:
    return Scatterers(
        made.thermal_co_albedo_in([band])[0], made.thermal_asymmetry_in([band])[0]
    )


def by_disort(depth, particles, at_top, at_base, below):
    """Cosines and upward radiances over a slab whose Planck function is linear in τ."""
    disort = pytest.importorskip("PythonicDISORT").pydisort
    moments = float(particles.asymmetry) ** np.arange(200)
    source = np.array([[at_top, (at_base - at_top) / depth]])
    cosines, _, _, mean = disort(
        np.array([depth]),
        np.array([1 - float(particles.co_albedo)]),
        STREAMS,
        moments[None, :],
        0.5,
        0.0,
        0.0,
        NFourier=1,
        f_arr=moments[STREAMS],
        b_pos=below,
        s_poly_coeffs=source,
    )[:4]
    up = STREAMS // 2
    return cosines[:up], np.ravel(mean(0.0))[:up]


@pytest.mark.parametrize("band", BANDS)
def test_brightness_temperatures_are_those_of_disort(band):
    """Geometry: droplets of 10 µm at 278 to 283 K over 290 K, crystals of 40 µm at 225
    to 237 K over 285 K, optical depths of 1, 4 and 30 at 0.64 µm, warmer at the base;
    seen at cosines of 0.36 to 0.99; sky above black.

    Expectation: upward radiance with scattering. Source: PythonicDISORT, 32 streams,
    Henyey-Greenstein. Tolerance: 0.5 K, where a pure absorber errs by 1 to 13 K.
    """
    bands = emissive_bands(band)
    for made, top, base, below in (
        (water(10.0), 278.0, 283.0, 290.0),
        (ice(40.0), 225.0, 237.0, 285.0),
    ):
        optics = particles_in(made, band)
        share = effective_share(optics.co_albedo, optics.asymmetry)
        ratio = float(made.effective_absorption_in([band])[0] / share) / float(
            made.extinction_in([2])[0]
        )
        planck = map(float, bands.planck(numbers(top, base, below))[0])
        at_top, at_base, ground = planck
        for depth in (1.0, 4.0, 30.0):
            cosines, true = by_disort(ratio * depth, optics, at_top, at_base, ground)
            used = cosines > 0.3
            found = _slab_radiance(
                ratio * depth, optics, share, cosines[used], at_top, at_base, ground
            )
            kelvin = bands.brightness_temperature_k(numbers(*found, *true[used])[None])
            error = np.subtract(*np.split(np.asarray(kelvin[0]), 2))
            assert np.abs(error).max() < 0.5


def _slab_radiance(depth, optics, share, cosines, at_top, at_base, below, steps=200):
    """What `EmittingSlabs` makes of a slab of one column per cosine."""
    slant = depth * float(share) / cosines
    changed = SLABS(numbers(*slant)[None], optics, numbers(*cosines))
    emitted, stopped = (np.asarray(x[0]) for x in (changed.emitted, changed.stopped))
    edges = np.exp(-slant[:, None] * np.linspace(0, 1, steps + 1))
    planck = at_top + (at_base - at_top) * (np.arange(steps) + 0.5) / steps
    own = (-np.diff(edges) * planck).sum(-1)
    return emitted * own + (1 - stopped * (1 - edges[:, -1])) * below


def test_energy_is_kept():
    """Geometry: any slab. Expectation: emissivity + reflectance + transmittance is one
    by construction, each between 0 and 1; without absorption nothing is emitted, and
    without scattering a slab is a pure absorber. Source: Kirchhoff's law. Tolerance:
    0.3 % in the last, which is the networks'.
    """
    slant = np.geomspace(1e-4, 100, 30)
    depth = jnp.asarray(np.broadcast_to(slant, (3, 1, 30)), float)
    optics = Scatterers(numbers(0.0, 0.3, 0.5), numbers(0.85, 0.95, 0.0))
    changed = jax.vmap(lambda d, o: SLABS(d, o, jnp.full(30, 0.8)))(depth, optics)
    absorbed = -np.expm1(-np.asarray(depth))
    emitted, stopped = changed.emitted * absorbed, changed.stopped * absorbed
    assert np.all(np.asarray(emitted[0]) == 0)
    assert np.all(np.asarray(emitted[1:]) > 0)
    assert np.all(np.asarray(stopped - emitted) > 0)
    assert np.all(np.asarray(stopped) <= 1 + 1e-6)


def test_thin_cloud_emits_what_it_absorbs():
    """Geometry: an optical depth of 1e-4. Expectation: emissivity k (1 - ω) L, which
    is (1 - ω)/share times that of the absorber. Source: the limit of single
    scattering. Tolerance: 30 % of that nothing, which is the networks' at nadir and an
    optical depth of 0.1; 8 % at a slant.
    """
    optics = particles_in(water(10.0), 7)
    changed = SLABS(jnp.full((1, 4), 1e-4), optics, numbers(1.0, 0.8, 0.6, 0.4))
    share = effective_share(optics.co_albedo, optics.asymmetry)
    ratio = np.asarray(changed.emitted[0] * share / optics.co_albedo)
    np.testing.assert_allclose(ratio, 1, atol=0.3)
    np.testing.assert_allclose(ratio[1:], 1, atol=0.08)


def test_stratus_is_colder_at_4_than_at_11_micrometres_by_night():
    """Geometry: a full layer of droplets of 10 µm, thick, 280 K throughout, seen from
    orbit. Expectation: at 11.2 µm within 0.6 K of 280 K, at 3.9 µm colder than there by
    2 to 5 K. Source: Hunt (1973, Q. J. R. Meteorol. Soc. 99, 346) and the night-time
    tests of fog, which are built on it (Ellrod 1995, Weather and Forecasting 10, 606);
    a pure absorber has 280 K in both.
    """
    droplets = water(10.0)
    full: dict[str, Any] = {
        "mask_gain": 0.0,
        "threshold": -30.0,
        "barrier_strength": 0.0,
    }
    own = layer(
        fractal_cloud(Shell(1000.0, 1500.0), **full),
        extinction_per_m=0.06,
        infrared_ratio=float(droplets.infrared_ratio),
        relative_absorption=droplets.relative_absorption_in([7, 14]),
        thermal_co_albedo=droplets.thermal_co_albedo_in([7, 14]),
        thermal_asymmetry=droplets.thermal_asymmetry_in([7, 14]),
    )
    bands, rays = emissive_bands(7, 14), geostationary_rays(8)
    air = TemperatureProfile(numbers(0, 8e3), numbers(280, 280))
    scene = make_scene([own], None, bands, temperature=air)
    scene = eqx.tree_at(lambda s: s.emission, scene, SLABS, is_leaf=lambda x: x is None)
    background = make_background(scene, 8, emitted=0.5)
    radiance = seen_along(scene, rays, sun(120.0), background).emissive
    assert radiance is not None
    short, long = np.asarray(bands.brightness_temperature_k(radiance))
    assert np.all(np.abs(long - 280) < 0.6)
    assert np.all((long - short > 2) & (long - short < 5))
