"""Priors of physical light: clouds that have been observed, before any fit."""

import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax_fit import embedded_target
from cloudjax_fit.condensate import OBSERVED_WATER
from cloudjax_fit.first_guess import PUBLISHED, START
from cloudjax_fit.fitted_scene import PARTICLES, build_scene, light_of, scene_parameters


def _least_barrier(start) -> float:
    """2 exp(-(z_t - z_b)/2h), in the middle between base and top."""
    return 2 * np.exp((start.base_m - start.top_m) / 2 / start.barrier_scale_m)


@pytest.mark.parametrize("name", PUBLISHED)
def test_clouds_cover_what_the_mask_says(name):
    """CF in the middle of the layer is then the textures and the mask alone."""
    start = PUBLISHED[name]
    assert start.threshold == pytest.approx(-_least_barrier(start), abs=0.05)


def test_stratus_is_that_of_the_literature():
    """Thickness, water and depth where the textures are one deviation above zero.

    CF = 0 where cosh(Δz/h) = (1 - T) over the least barrier. 200 to 400 m, 0.2 to 0.6
    g/m³, optical depths of 5 to 20: Wood (2012), as in docs/theory/light.md.
    """
    start = PUBLISHED["low_stratus"]
    above = (1 - start.threshold) / _least_barrier(start)
    thickness_m = 2 * start.barrier_scale_m * np.arccosh(above)
    water = float(
        PARTICLES["low_stratus"].water_content_g_m3(jnp.asarray(start.extinction_per_m))
    )
    assert 200 < thickness_m < 400
    assert 0.2 < water < 0.6
    assert 5 < start.extinction_per_m * thickness_m < 20
    # Three deviations of the prior of extinction are what has been measured at all.
    least, most = OBSERVED_WATER["low_stratus"]
    assert least < water * np.exp(-3 * start.extinction_spread)
    assert water * np.exp(3 * start.extinction_spread) < most


@pytest.mark.parametrize(
    ("light", "starts"), [("physical", PUBLISHED), ("paper", START)]
)
def test_scenes_start_there(light, starts):
    target = embedded_target()
    scene = build_scene(target, light=light)
    share = light_of(scene).share
    parameters = {p.name: p for p in scene_parameters(scene, target)}
    for layer in scene.layers:
        start = starts[layer.name]
        assert layer.cloud.shell == start.shell
        own = {n.split(".")[1]: p for n, p in parameters.items() if layer.name in n}
        assert own["top"].default == start.top_m
        assert (own["top"].lower, own["top"].upper) == start.top_bounds_m
        assert own["extinction"].default == pytest.approx(
            share * start.extinction_per_m
        )
        assert own["extinction"].spread == start.extinction_spread
        assert own["barrier_scale"].spread == start.scale_spread
        assert own["infrared_ratio"].spread == start.infrared_spread
