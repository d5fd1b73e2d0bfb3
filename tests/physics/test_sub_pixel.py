"""Structure below the pixel: one soft ray against the mean of many hard ones.

The experiment is that of `benchmarks/footprint.py`, smaller.
"""

import numpy as np
import pytest
from benchmarks.footprint import VIEWS, blocks, gains


SIDE, SEEDS = 14, 2


# Least gain of the distance between the pixels' distributions, of the root mean square
# over pixels, and largest bias.
EXPECTED = {
    "GEO nadir": (3.6, 2.6, 0.05),
    "GEO near the limb": (1.7, 2.0, 0.04),
    "LEO, 20 m": (1.0, 0.9, 0.07),
}


@pytest.mark.parametrize(
    "name",
    [
        "GEO nadir",
        "GEO near the limb",
        pytest.param("LEO, 20 m", marks=pytest.mark.slow),
    ],
)
def test_one_soft_ray_beats_one_hard_ray(name):
    """Geometry: 14² pixels at two places, seen near the nadir and near the limb of a
    geostationary satellite (2 km) and from 700 km (20 m); broken low cloud, sun at 53
    degrees.

    Expectation: nearer to the mean of 64 hard rays per pixel with 160 and more steps
    than one hard ray is, both with 24 steps, by the factors of `EXPECTED`. Source: the
    hard level set of Schinder et al. (2024), averaged. Tolerance: some 10 to 25 % below
    what was measured: gains of 5.2 and 2.7, 4.7 and 2.2, 1.2 and 1.0. From low
    orbit a pixel of 20 m resolves nearly all there is and one hard ray is nearly right:
    what is left is the error of the steps.
    """
    found = gains(VIEWS[name], SEEDS, SIDE)
    w1, rmse, bias = EXPECTED[name]
    assert found["w1_gain"] > w1
    assert found["rmse_gain"] > rmse
    assert abs(found["bias"]) < bias


@pytest.mark.slow
def test_means_of_low_orbit_and_of_a_geostationary_pixel_agree():
    """Geometry: 8² pixels of 2 km near the nadir and as many blocks of 20² rays from
    700 km on the same line of sight, each ray with the footprint of its 100 m.

    Expectation: the same mean. Source: the clouds are the same and so is the light.
    Tolerance: 6 % of the mean; single pixels scatter more, for one ray does not know
    where in the pixel the clouds are (printed by the benchmark).
    """
    found = blocks(VIEWS["GEO nadir"], seeds=2, side=8, parts=20)
    assert abs(found["mean"]) < 0.06
    assert abs(found["mean_of_64_hard_rays"]) < 0.04
    assert found["rmse_of_64_hard_rays"] < 0.06
    assert np.isfinite(found["rmse"])
