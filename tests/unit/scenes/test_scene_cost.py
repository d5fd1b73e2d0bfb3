"""What parts of a scene cost: what is off costs no operations, and is told so."""

import time
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import (
    Air,
    EmittingSlabs,
    Latent,
    PlaneParallel,
    ReflectiveBands,
    Shadows,
    Slabs,
    bands_named,
    look,
)
from cloudjax.light.ground import Lambertian
from cloudjax_scenes import scene_cost
from cloudjax_scenes.scene_cost import costs, operations, parts_of
from tests.helpers import (
    emissive_bands,
    fractal_cloud,
    geostationary_rays,
    layer,
    make_scene,
    reflective_bands,
    sun,
    under_weather,
)


RAYS = geostationary_rays(16)
SUN = sun(40.0)
OF_BANDS = {
    "reflective": 2,
    "emissive": 2,
    "steps": 4,
    "co_albedo": [0.01, 0.1],
    "asymmetry": [0.85, 0.8],
    "thermal_co_albedo": [0.4, 0.5],
    "thermal_asymmetry": [0.9, 0.8],
}


def _scene():
    """Every part of the model is used."""
    networks = PlaneParallel.load()
    cloud = fractal_cloud(nodes=3)
    scene = make_scene(
        [layer(cloud, name=name, **OF_BANDS) for name in ("one", "nowhere")],
        ReflectiveBands.of(bands_named(1, 7)),
        emissive_bands(7, 13),
        air=Air.of_bands((1, 7, 13)),
        shadows=Shadows(2, points=2),
    )
    scene = replace(scene, reflection=Slabs(networks), emission=EmittingSlabs(networks))
    return under_weather(scene, [lambda φ, λ: 0 * φ, lambda φ, λ: 0 * φ - 1e4])


@pytest.fixture(scope="module")
def whole():
    scene = _scene()
    view = look(scene, RAYS, SUN)
    return scene, view, {part.name: part for part in parts_of(scene, RAYS, view)}


PARTS = ("layer one", "shadows", "gases", "Rayleigh", "thermal scattering",
         "sub-pixel nodes")  # fmt: skip


@pytest.mark.slow
def test_views_without_a_part_are_those_of_scenes_without_it(whole):
    _, view, parts = whole
    for name in ("layer one", "shadows", "sub-pixel nodes"):
        part = parts[name]
        assert part.without is not None
        own = operations(part.without, look(part.without, RAYS, SUN))
        assert operations(part.without, part.seen(view)) == pytest.approx(own), name


def test_what_is_off_is_told(whole):
    scene, view, parts = whole
    nowhere = parts["layer nowhere"]
    assert "nowhere in view" in nowhere.why
    # It is laid and sampled all the same.
    assert nowhere.used
    bare = replace(
        scene, air=None, shadows=None, emission=None, reflective=reflective_bands(1)
    )
    single = [
        replace(la, cloud=replace(la.cloud, latent=Latent.equal_shares(1)))
        for la in scene.layers
    ]
    told = {
        p.name: p for p in parts_of(replace(bare, layers=tuple(single)), RAYS, view)
    }
    off = {name for name, part in told.items() if not part.used}
    assert off == {
        *("shadows", "gases", "Rayleigh", "thermal scattering", "sunlight in band 7"),
        *("wind", "sub-pixel nodes", "glint"),
    }
    assert told["sunlight in band 7"].why == "the sun is down"
    assert all(part.without is None for part in told.values() if not part.used)


def test_ground_that_mirrors_the_sun_is_told(whole):
    """By a view of such ground; where no band sees the sun it counts for nothing."""
    scene, view, _ = whole
    one = jnp.ones((len(RAYS), 2))
    mirror = Lambertian(one, None, 288 * one[:, 0], one)
    ground = replace(view.around.ground, properties=mirror)
    view = replace(view, around=replace(view.around, ground=ground))
    for bands, used in ((scene.reflective, True), (None, False)):
        parts = parts_of(replace(scene, reflective=bands), RAYS, view)
        assert {part.name: part.used for part in parts}["glint"] == used


def test_operations_stand_for_seconds_where_time_is_short(whole, monkeypatch):
    """What is off costs none: a scene without a part has fewer than the whole.

    A render that only takes its time is as good as any.
    """
    scene, view, _ = whole
    monkeypatch.setattr(scene_cost, "render", lambda *_, **__: time.sleep(0.05))
    monkeypatch.setattr(scene_cost, "look", lambda *_: view)
    found = dict(
        (part.name, cost)
        for part, cost in costs(scene, RAYS, SUN, pixels=160, budget_s=1e-3)
    )
    every = found["all of it"]
    assert every.timed
    assert every.seconds is not None
    for name in PARTS:
        assert not found[name].timed
        seconds = found[name].seconds
        assert seconds is not None
        assert 0 < seconds < every.seconds
    assert found["wind"].seconds is None
    assert np.isfinite(every.seconds)
