"""Branches towards the sun, what is left out, and derivatives on the hard set."""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import (
    FractalCloud,
    Rays,
    Scene,
    Shadows,
    Shell,
    Wind,
    displacement_map,
    radiances,
)
from cloudjax.clouds.ladder import frames, kept
from cloudjax.geometry.geodesy import geodetic
from cloudjax.geometry.path import Path, on_chord
from cloudjax.geometry.shells import Chords, chords
from cloudjax.march.shadows import Shades, dimming, levels_passed_m
from cloudjax.march.view import make_textures, sample
from tests.helpers import (
    LOW_SHELL,
    SMOOTH,
    emissive_bands,
    fractal_cloud,
    geostationary_rays,
    lay_along,
    layer,
    limb_rays,
    make_scene,
    reflective_bands,
    sampling,
    sun,
    view_along,
    with_pixels,
)


RAYS = geostationary_rays(12)
STEPS = Shadows(2)


def _scene(*layers, shadows: Shadows | None = STEPS, thermal=False) -> Scene:
    bands = (None, emissive_bands(13)) if thermal else (reflective_bands(1), None)
    scene = make_scene(layers or [_layer()], *bands)
    return dataclasses.replace(scene, shadows=shadows)


def _layer(extinction: Any = 0.01, shell: Shell | None = None, **changes):
    cloud = fractal_cloud(shell or LOW_SHELL, nodes=2, **changes)
    return layer(cloud, extinction_per_m=extinction, asymmetry=[0.85], steps=4)


def _for_each(direction: np.ndarray):
    return jnp.broadcast_to(jnp.asarray(direction, float), (len(RAYS), 3))


def _blown(cloud: FractalCloud, moved) -> FractalCloud:
    return dataclasses.replace(cloud, displacements=(moved, moved))


def test_values_on_a_chord_are_linear_between_knots_and_beyond():
    knots = [jnp.asarray([0.0]), jnp.asarray([2.0]), jnp.asarray([3.0])]
    for at, expected in ((0.0, 0), (0.25, 1), (0.5, 2), (1.0, 3), (-0.5, -2), (2.0, 5)):
        np.testing.assert_allclose(on_chord(knots, jnp.asarray([at])), [expected])


@pytest.mark.parametrize("knots", [2, 9])
@pytest.mark.parametrize("part", [-0.3, 0.4, 1.2])
def test_a_branch_runs_towards_the_sun(knots, part):
    """Altitudes and textures are those of the points in space, to float32."""
    cloud, direction = fractal_cloud(), sun(60.0)
    chord = chords(RAYS, cloud.shell)
    left, textures = part * chord.length_m, cloud.make_textures()
    ends = np.array([200.0, 500.0, 1500.0, 4000.0])
    branch = cloud.branch(
        cloud.navigate(RAYS, chord, sampling(500.0, knots)),
        textures,
        jnp.asarray(left, float),
        _for_each(direction),
        jnp.broadcast_to(jnp.asarray(ends, float), (len(RAYS), 4)),
    )
    found = cloud.sample(branch, textures, steps=3, slopes=False)
    middle = (ends[1:] + ends[:-1]) / 2
    start = RAYS.at(chord.entry_m + left)
    place = start[:, None] + middle[None, :, None] * direction
    distance = found.path.distance_m(3)
    np.testing.assert_allclose(distance[0], middle, rtol=1e-6)
    altitude = found.path.altitude_m(distance)
    np.testing.assert_allclose(altitude, geodetic(place)[2], atol=0.1)
    amplitude, *_ = kept(textures.wavenumbers, textures.powers, cloud.pixel(branch, 3))
    parts = frames(cloud.ladders, cloud.seed)
    for i, (frame, shift) in enumerate(zip(*parts, strict=True)):
        u = place @ frame.T.astype(float) + shift
        u = jnp.asarray(np.moveaxis(u % 1, -1, 0)[:, None], float)
        (expected,) = textures.noise.sample(textures.band[i : i + 1], u)
        alone = found.fractal(jnp.eye(len(cloud.rungs))[i], 3)
        np.testing.assert_allclose(alone, amplitude[i][:, None] * expected, atol=1e-4)


def test_a_branch_follows_the_wind():
    """Textures as on rays that are navigated from the branching points themselves.

    Tolerance: 0.01 of a standard deviation, for how air is strained is that of the
    first point of the ray.
    """
    latitude, longitude = np.arange(-90.0, 91, 10), np.arange(0.0, 360, 10)
    northward = 5 * np.sin(np.radians(latitude))[None, :, None] + np.zeros((1, 19, 36))
    eastward = np.full((1, 19, 36), 20.0)
    wind = Wind(eastward, northward, latitude, longitude, radius_m=6.378e6)
    moved = displacement_map(wind, hours=10.0, resolution_deg=5.0)
    cloud, direction = _blown(fractal_cloud(), moved), sun(60.0)
    chord = chords(RAYS, cloud.shell)
    left = 0.6 * chord.length_m
    ends = jnp.broadcast_to(jnp.linspace(0, 4000.0, 4)[None], (len(RAYS), 4))
    lines, textures = with_pixels(RAYS, 0.0), cloud.make_textures()
    way = cloud.navigate(lines, chord, sampling())
    left_m = jnp.asarray(left, float)
    branch = cloud.branch(way, textures, left_m, _for_each(direction), ends)
    start = RAYS.at(chord.entry_m + left)
    onward = Rays(start, np.broadcast_to(direction, start.shape), 0.0)
    whole = Chords(np.zeros(len(RAYS)), np.full(len(RAYS), 4000.0))
    found, expected = (
        cloud.sample(one, textures, steps=3, slopes=False)
        for one in (branch, cloud.navigate(onward, whole, sampling()))
    )
    for one in jnp.eye(len(cloud.rungs)):
        np.testing.assert_allclose(
            found.fractal(one, 3), expected.fractal(one, 3), atol=0.01
        )


def _shades(scene: Scene) -> Shades | None:
    ways = lay_along(scene, RAYS, sun(30.0))
    return eqx.filter_eval_shape(sample, scene, ways, make_textures(scene)).shades


def test_what_is_not_asked_is_not_looked_for():
    for scene in (_scene(shadows=None), _scene(thermal=True)):
        assert _shades(scene) is None


def test_layers_below_shade_nothing_above():
    low, high = _layer(), _layer(shell=Shell(4000.0, 6000.0))
    scene = _scene(low, high)
    shades = _shades(scene)
    assert shades is not None
    cast = [[shade is not None for shade in way] for way in shades.ways]
    assert cast == [[True, True], [False, True]]


def test_no_steps_are_refused():
    with pytest.raises(ValueError, match="leave them out"):
        Shadows(0)
    with pytest.raises(ValueError, match="at both ends of a way"):
        Shadows(points=1)


# Of the ray's way where its light turns, between the points that are looked from.
PART = jnp.linspace(-0.1, 1.1, len(RAYS))


def _left(x, view):
    """Mean and mean square of what shadows leave of a cloud's light and the ground's.

    For threshold, top, the logarithm of the extinction and where light turns.
    """
    cloud = {"threshold": 0.2 + 0.1 * x[0], "top_m": 3e3 + 200 * x[1]}
    scene = _scene(_layer(0.01 * jnp.exp(x[2]), **cloud))
    assert view.shades is not None
    sources = [one.cloud for one in scene.layers]
    returned = [one.returned_per_m for one in scene.layers]
    part = jnp.resize(PART, view.shades.ground[0].rise_m.shape[0]) + 0.1 * x[3]
    left = (
        dimming(view.shades.ways[0], sources, returned, own=0, part=part),
        dimming(view.shades.ground, sources, returned),
    )
    return jnp.stack([f(part) for part in left for f in (jnp.mean, jnp.var)])


def test_derivatives_of_both_modes_and_differences_agree():
    """In double precision, through the point where light turns as well.

    The samples towards the sun do not depend on it: it only says where between the
    points of a ray they are read.
    """
    with jax.enable_x64(True):
        view = view_along(_scene(), RAYS, sun(60.0), width_m=2e3)

        @jax.jit
        def forward(x):
            return jax.jacfwd(lambda x: (_left(x, view),) * 2, has_aux=True)(x)

        found, _ = forward(jnp.zeros(4))
        reverse = jax.jit(jax.jacrev(lambda x: _left(x, view)))(jnp.zeros(4))
        ends = [forward(s)[1] - forward(-s)[1] for s in 1e-5 * jnp.eye(4)]
        differences = jnp.stack(ends, axis=-1) / 2e-5
    np.testing.assert_allclose(found, reverse, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found, differences, rtol=1e-4, atol=1e-6)
    assert np.all(np.abs(found).max(0) > 1e-4), "a parameter does nothing"


HARD = [
    *[(0.0, 0.0, zenith) for zenith in (0.0, 89.99, 90.0, 90.01, 180.0)],
    *[
        (threshold, log, 88.0)
        for threshold in (-400.0, 400.0)
        for log in (-200.0, 14.0)
    ],
]


def test_hard_cases_are_finite():
    """Sun at the horizon, empty and full sky, optical depths of 0 and 1e7, the limb."""
    rays = limb_rays(-5e3, 1e3, 3e3, 1e4)

    @jax.jit
    def both(x, view):
        return jax.jacfwd(lambda x: (_left(x, view),) * 2, has_aux=True)(x)

    for threshold, log, zenith in HARD:
        view = view_along(_scene(), rays, sun(zenith, 0.0, 90.0), twice=True)
        x = jnp.asarray([threshold, 0.0, log, 0.0])
        for part in both(x, view):
            assert np.isfinite(part).all(), (threshold, log, zenith)


def _bright(view, scene):
    seen = radiances(scene, view).reflective
    assert seen is not None
    return np.asarray(seen)


@pytest.mark.parametrize("change", [{"threshold": -0.3}, {"top_m": 2200.0}])
def test_a_view_with_shadows_follows_the_parameters(change):
    """The samples towards the sun are those of geometry alone."""
    view = view_along(_scene(), RAYS, sun(60.0))
    changed = _scene(_layer(**change))
    again = view_along(changed, RAYS, sun(60.0))
    found, expected = _bright(view, changed), _bright(again, changed)
    np.testing.assert_array_equal(found, expected)
    unshaded = dataclasses.replace(changed, shadows=None)
    plain = _bright(view_along(unshaded, RAYS, sun(60.0)), unshaded)
    assert np.abs(found - plain).max() > 0.005 * plain.max()


def test_more_points_of_a_ray_find_the_shadows_of_few():
    """Depths are linear between 5 points of a ray; 17 change less than shadows do.

    In a march of 12 steps, which sees the edges of clouds. Measured: 0.15.
    """

    def seen(shadows):
        # Without creases, which are as sharp at any number of points.
        smooth = dataclasses.replace(_layer(second=SMOOTH), steps=12)
        scene = _scene(smooth, shadows=shadows)
        return _bright(view_along(scene, RAYS, sun(60.0)), scene)

    none, few, many = (seen(s) for s in (None, Shadows(8), Shadows(8, points=17)))
    assert np.abs(few - many).mean() < 0.2 * np.abs(many - none).mean()


def test_below_a_cloud_none_of_it_is_between_the_viewer_and_the_ground():
    """A camera 2 m above the ground had its ground brightened by what is over it: its
    derivative by the albedo was a million times too large."""
    up = jnp.asarray([[0.0, 0.0, 1.0]])
    levels = jnp.asarray([[0.0, 1.0, 1500.0, 4000.0]])
    for height, length, expected in (
        (2.0, 2.0, [1, 1, 0]),
        (4000.0, 4000.0, [1, 1499, 2500]),
        (4000.0, 0.0, [0, 0, 0]),
    ):
        path = Path(
            length_m=jnp.asarray([length]),
            entry_altitude_m=jnp.asarray([height]),
            radius_m=jnp.asarray([6.37e6]),
            direction=-up,
            entry_up=up,
        )
        found = np.diff(levels_passed_m(levels, path))
        np.testing.assert_allclose(found[0], expected, atol=0.01)
