"""Extinction of whole fields, against the optics of one radius."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import Particles
from cloudjax.light.bulk_extinction import extinction_m2_g


@pytest.mark.parametrize(("phase", "low", "high"), [("water", 2, 65), ("ice", 9.4, 65)])
def test_the_table_is_the_optics_of_each_radius(phase, low, high):
    radius = jnp.asarray(np.geomspace(low, high, 23), float)
    expected = [float(Particles(phase, r).extinction_in([2])[0]) for r in radius]
    np.testing.assert_allclose(extinction_m2_g(phase, radius), expected, rtol=2e-4)


@pytest.mark.parametrize("phase", ["water", "ice"])
def test_large_particles_take_light_by_their_area(phase):
    large = extinction_m2_g(phase, jnp.asarray([100.0, 200.0, 1000.0]))
    np.testing.assert_allclose(large[0] / large[1:], [2, 10], rtol=1e-5)
    assert np.isfinite(extinction_m2_g(phase, jnp.zeros(2))).all()


def test_it_has_derivatives_by_the_radius():
    radius = jnp.asarray([5.0, 20.0, 300.0])
    slope = jax.jvp(lambda r: extinction_m2_g("water", r), (radius,), (radius,))[1]
    found = slope / extinction_m2_g("water", radius)
    # Nearly 1/r.
    np.testing.assert_allclose(found, -1, atol=0.08)
