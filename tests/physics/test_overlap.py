"""Layers whose shells overlap or follow each other, seen from all sides."""

import itertools
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import Rays, Scene, Shell, TemperatureProfile
from cloudjax.geometry.geodesy import ecef, geodetic, up
from cloudjax.geometry.shells import chords
from tests.helpers import (
    emissive_bands,
    fractal_cloud,
    geostationary_rays,
    layer,
    limb_rays,
    make_background,
    make_scene,
    reflective_bands,
    seen_along,
    sun,
)


FULL: dict[str, Any] = {"mask_gain": 0.0, "threshold": -30.0, "barrier_strength": 0.0}
LOW, HIGH = Shell(1000.0, 4000.0), Shell(2500.0, 6000.0)
PLACE = np.array([20.0]), np.array([10.0])
BAND = emissive_bands(13)


def _towards(altitude_m: float, zenith_deg) -> Rays:
    """Rays from an altitude over 20 N 10 E at angles from the zenith, northwards."""
    θ = np.radians(np.asarray(zenith_deg, float))[:, None]
    vertical = up(*PLACE)
    north = np.cross(vertical, np.cross([0, 0, 1.0], vertical))
    direction = np.cos(θ) * vertical + np.sin(θ) * north
    origin = ecef(*PLACE, np.array([altitude_m]))
    return Rays(np.broadcast_to(origin, direction.shape), direction, 1e-4)


# As many rays each, so that one compilation serves all.
VIEWS = {
    "from space": geostationary_rays(4),
    "from the ground": _towards(0.0, [0, 20, 50, 75]),
    "from within, up": _towards(3000.0, [0, 30, 60, 80]),
    "from within, down": _towards(3000.0, [180, 150, 120, 100]),
    "from an aircraft between": _towards(5000.0, [180, 130, 0, 40]),
}


def _scene(*parts, kelvin=(250.0, 250.0), steps=24) -> Scene:
    """Full layers of a shell and an infrared extinction each, one ratio for all."""
    layers = [
        layer(
            fractal_cloud(shell, **FULL),
            extinction_per_m=extinction,
            infrared_ratio=1.0,
            steps=steps,
        )
        for shell, extinction in parts
    ]
    air = TemperatureProfile(jnp.asarray([0.0, 8e3]), jnp.asarray(kelvin))
    return make_scene(layers, None, BAND, temperature=air)


def _emitted(scene: Scene, rays: Rays, behind=100.0) -> np.ndarray:
    background = make_background(scene, len(rays), emitted=behind)
    seen = seen_along(scene, rays, sun(30.0), background).emissive
    assert seen is not None
    return np.asarray(seen[0], float)


def _behind(rays: Rays, level: float | np.ndarray = 100.0) -> np.ndarray:
    """What is seen without cloud: nothing beside the Earth, for those who look up."""
    return np.where(rays.ground()[1], level, 0.0)


def _integrated(rays: Rays, parts, kelvin, steps=4000) -> np.ndarray:
    """∫ B(T) κ exp(-∫κ) ds + background, κ summed over the layers, in float64."""
    shell = Shell(min(s.bottom_m for s, _ in parts), max(s.top_m for s, _ in parts))
    whole = chords(rays, shell)
    ds = whole.length_m[:, None] / steps
    distance = whole.entry_m[:, None] + ds * (np.arange(steps) + 0.5)
    extinction = np.zeros_like(distance)
    for part, per_m in parts:
        chord = chords(rays, part)
        ahead = distance - chord.entry_m[:, None]
        extinction += per_m * ((ahead > 0) & (ahead < chord.length_m[:, None]))
    place = rays.origin_m[:, None] + distance[..., None] * rays.direction[:, None]
    air = np.interp(geodetic(place)[2], [0.0, 8e3], kelvin)
    planck = np.asarray(BAND.planck(jnp.asarray(air, float))[0], float)
    depth = np.cumsum(extinction * ds, axis=-1)
    before = np.exp(-(depth - extinction * ds))
    emitted = (planck * before * -np.expm1(-extinction * ds)).sum(-1)
    return emitted + _behind(rays) * np.exp(-depth[:, -1])


@pytest.mark.parametrize("view", VIEWS.values(), ids=VIEWS)
def test_optical_depths_add_whatever_the_order(view):
    """Geometry: two full layers from 1 to 4 and from 2.5 to 6 km, 250 K throughout.

    Expectation: B (1 - T) + T L with T = exp(-(τ₁ + τ₂)), each τ the extinction times
    the chord, seen from space, from the ground, from within both and from above one;
    L is 0 where a ray misses the Earth, and its T is not seen apart.
    Source: Beer's law. Tolerance: 2e-3 of B - L, which is how far the transmittance in
    front of a step, taken at its middle, errs where shells begin; transmittances of
    both orders agree to float32.
    """
    parts = (LOW, 2e-4), (HIGH, 3e-4)
    depth = sum(β * chords(view, shell).length_m for shell, β in parts)
    planck = float(BAND.planck(jnp.asarray(250.0))[0])
    expected = planck + np.exp(-depth) * (_behind(view) - planck)
    found = [_emitted(_scene(*order), view) for order in (parts, parts[::-1])]
    np.testing.assert_allclose(found[0], found[1], rtol=1e-6)
    np.testing.assert_allclose(found[0], expected, atol=2e-3 * abs(100 - planck))
    dark = [_emitted(_scene(*parts), view, behind) for behind in (0.0, 100.0)]
    passed, through = (dark[1] - dark[0]) / 100, _behind(view, np.exp(-depth))
    np.testing.assert_allclose(passed, through, rtol=2e-5, atol=1e-6)


@pytest.mark.parametrize("view", VIEWS.values(), ids=VIEWS)
def test_emission_is_that_of_the_summed_extinction(view):
    """Geometry: as above, 290 K at the ground and 220 K from 8 km on, optically thick
    and thin layers. Expectation: the emission integral with the summed extinction, by
    4000 steps in float64. Source: the equation of transfer. Tolerance:
    1.5e-3 of the difference between the warmest and the coldest black body with 24
    steps, 5e-4 with 48 (measured from space and within: 6e-4 and 2e-4).
    """
    parts = (LOW, 3e-4), (HIGH, 6e-4)
    kelvin = (290.0, 220.0)
    span = float(np.ptp(np.asarray(BAND.planck(jnp.asarray(kelvin))[0])))
    expected = _integrated(view, parts, kelvin)
    errors = [
        np.abs(_emitted(_scene(*parts, kelvin=kelvin, steps=n), view) - expected)
        for n in (24, 48)
    ]
    assert errors[0].max() < 1.5e-3 * span
    assert errors[1].max() < 5e-4 * span


@pytest.mark.parametrize("view", ["from space", "from the ground"])
def test_two_coincident_layers_are_one_of_twice_the_extinction(view):
    """Geometry: a full layer of 3 km in air that cools upwards.

    Expectation: split into two of half the extinction in the same shell it emits the
    same. Source: extinctions add. Tolerance: 1e-4: where the
    steps agree each half is dimmed by the other as in the middle of each step.
    """
    kelvin = (290.0, 220.0)
    one = _emitted(_scene((LOW, 8e-4), kelvin=kelvin), VIEWS[view])
    two = _emitted(_scene((LOW, 4e-4), (LOW, 4e-4), kelvin=kelvin), VIEWS[view])
    np.testing.assert_allclose(two, one, rtol=1e-4)


@pytest.mark.parametrize(
    ("view", "nearest"), [("from space", 1), ("from the ground", 0)]
)
def test_of_layers_apart_the_nearer_hides_the_farther(view, nearest):
    """Geometry: opaque layers from 1 to 2 and from 5 to 6 km, in both orders.

    Expectation: the black body of the side that looks at the sensor: 290 K at the
    ground falls to 220 K at 8 km, so that the lid of the upper has 237.5 K and the
    floor of the lower 281.25 K. Source: an opaque layer lets nothing through.
    Tolerance: 0.4 K, for a step of 42 m has the air of its middle.
    """
    parts = (Shell(1e3, 2e3), 1.0), (Shell(5e3, 6e3), 1.0)
    kelvin = (281.25, 237.5)[nearest]
    low, high = (float(BAND.planck(jnp.asarray(kelvin + d))[0]) for d in (-0.4, 0.4))
    for order in itertools.permutations(parts):
        seen = _emitted(_scene(*order, kelvin=(290.0, 220.0)), VIEWS[view])
        assert np.all((seen > low) & (seen < high))


def test_sunlight_of_layers_does_not_depend_on_their_order():
    """Geometry: two broken layers in overlapping shells, from space.

    Expectation: the same radiances for both orders. Source: a set of layers has no
    order. Tolerance: 1e-5, float32.
    """
    clouds = [
        layer(fractal_cloud(shell, threshold=-0.5, base_m=base, top_m=base + 2500))
        for shell, base in ((LOW, 1200.0), (HIGH, 2900.0))
    ]
    rays = VIEWS["from space"]

    def seen(layers):
        scene = make_scene(layers, reflective_bands(1))
        background = make_background(scene, len(rays), reflected=0.0)
        found = seen_along(scene, rays, sun(30.0), background).reflective
        assert found is not None
        return np.asarray(found)

    found = seen(clouds)
    np.testing.assert_allclose(seen(clouds[::-1]), found, rtol=1e-5)
    assert found.min() > 0


def test_second_chords_lie_behind_the_first():
    """Geometry: rays that pass the limb below a cold opaque shell, air 290 to 220 K.

    Expectation: the near side hides the far side, so that following rays a second time
    changes nothing; a thin shell shows as much again. Source: order along the ray.
    Tolerance: 1e-4 where opaque; within 3 % of twice the optical depth where thin.
    """
    rays = limb_rays(200.0, 350.0, 500.0, 800.0)
    for extinction, thin in ((1e-2, False), (1e-7, True)):
        scene = _scene((LOW, extinction))
        background = make_background(scene, len(rays), emitted=0.0)
        once, twice = (
            np.asarray(
                seen_along(scene, rays, sun(30.0), background, twice=both).emissive
            )
            for both in (False, True)
        )
        expected = 2 * once if thin else once
        np.testing.assert_allclose(twice, expected, rtol=0.03 if thin else 1e-4)
