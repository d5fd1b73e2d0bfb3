"""What fits start from: clouds that have been observed, before any fit."""

import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import ParticleOptics, imagery_classes
from cloudjax_fit import embedded_target, scene_parameters
from cloudjax_fit.fitted_cloud import OBSERVED_WATER
from cloudjax_scenes import LIGHTS, SceneFromImagery


PHYSICAL = imagery_classes()


def _least_barrier(one) -> float:
    """2 exp(-(z_t - z_b)/2h), in the middle between base and top."""
    return 2 * np.exp((one.base_m - one.top_m) / 2 / one.barrier_scale_m)


@pytest.mark.parametrize("name", PHYSICAL)
def test_clouds_cover_what_the_mask_says(name):
    """CF in the middle of the layer is then the textures and the mask alone."""
    one = PHYSICAL[name]
    assert one.threshold == pytest.approx(-_least_barrier(one), abs=0.05)


def test_stratus_is_that_of_the_literature():
    """Thickness, water and depth where the textures are one deviation above zero.

    CF = 0 where cosh(Δz/h) = (1 - T) over the least barrier. 200 to 400 m, 0.2 to 0.6
    g/m³, optical depths of 5 to 20: Wood (2012), as in docs/theory/light.md.
    """
    one = PHYSICAL["low_stratus"]
    above = (1 - one.threshold) / _least_barrier(one)
    thickness_m = 2 * one.barrier_scale_m * np.arccosh(above)
    water = float(one.optics.water_content_g_m3(jnp.asarray(one.extinction_per_m)))
    assert 200 < thickness_m < 400
    assert 0.2 < water < 0.6
    assert 5 < one.extinction_per_m * thickness_m < 20
    # Three deviations of the prior of extinction are what has been measured at all.
    least, most = OBSERVED_WATER["low_stratus"]
    spread = one.priors["extinction_per_m"].spread
    assert least < water * np.exp(-3 * spread)
    assert water * np.exp(3 * spread) < most


@pytest.mark.parametrize("light", LIGHTS.values(), ids=list(LIGHTS))
def test_scenes_start_there(light):
    made_of = SceneFromImagery(embedded_target().imagery, light=light)
    parameters = {p.name: p for p in scene_parameters(made_of)}
    for layer, one in zip(made_of.build().layers, made_of.classes, strict=True):
        assert layer.name == one.name
        assert layer.cloud.shell == one.shell
        own = {n.split(".")[1]: p for n, p in parameters.items() if one.name in n}
        assert own["top"].default == one.top_m
        assert own["top"].lower == one.priors["top_m"].lower
        extinction = own["extinction"]
        assert extinction.default == pytest.approx(light.share * one.extinction_per_m)
        assert (extinction.lower, extinction.upper) == pytest.approx((1e-6, 1.0))
        assert float(layer.extinction_per_m) == pytest.approx(extinction.default)
        # Only the paper's light asks for a ratio of its own.
        if "infrared_ratio" in own:
            assert isinstance(layer.optics, ParticleOptics)
            assert layer.optics.infrared_ratio is not None
            ratio = float(layer.optics.infrared_ratio)
            assert ratio == pytest.approx(own["infrared_ratio"].default)
        assert ("infrared_ratio" in own) == (light.name == "paper")
