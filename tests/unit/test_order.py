"""How much of one layer lies in front of each step of another."""

import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import Shell
from cloudjax.march.order import Stretch, Within, overlap, place
from tests.helpers import numbers


PROFILE = numbers(1.0, 0.8, 0.5, 0.1)[None]  # at 0, 1/3, 2/3 and the end


def _stretch(start, length) -> Stretch:
    return Stretch(numbers(start), numbers(length))


@pytest.mark.parametrize(
    ("one", "other", "expected"),
    [
        ((0, 1e3), (1e3, 2e3), False),
        ((0, 1e3), (999, 2e3), True),
        ((0, 5e3), (1e3, 2e3), True),
        ((3e3, 4e3), (1e3, 2e3), False),
        ((1e3, 2e3), (1e3, 2e3), True),
    ],
)
def test_shells_overlap_where_they_share_air(one, other, expected):
    shells = (Shell(*map(float, one)), Shell(*map(float, other)))
    assert overlap(*shells) == overlap(*shells[::-1]) == expected


def test_points_read_the_profile_where_they_are():
    """A stretch from 100 m to 400 m; points before, at, within and behind it."""
    other, own = _stretch(100.0, 300.0), _stretch(50.0, 500.0)
    distance = numbers(0.0, 50.0, 100.0, 150.0, 250.0, 350.0, 480.0)[None]
    where = place(other, 3, own, distance, overlapping=True)
    expected = np.interp(
        np.asarray(distance[0]) + 50, [100, 200, 300, 400], np.asarray(PROFILE[0])
    )
    np.testing.assert_allclose(where.read(PROFILE)[0], expected, rtol=1e-6)


@pytest.mark.parametrize(("start", "expected"), [(0.0, 1.0), (700.0, 0.1)])
def test_apart_all_of_the_nearer_lies_in_front(start, expected):
    """At the start of the own way nothing or everything of the other is passed."""
    own, other = _stretch(start, 100.0), _stretch(300.0, 300.0)
    where = place(other, 3, own, numbers(10.0, 90.0)[None], overlapping=False)
    found = jnp.broadcast_to(where.read(PROFILE), (1, 1))
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_an_empty_stretch_dims_nothing_and_stays_finite():
    where = place(
        _stretch(100.0, 0.0), 3, _stretch(0.0, 300.0), numbers(5.0, 99.0, 250.0)[None],
        overlapping=True,
    )  # fmt: skip
    assert isinstance(where, Within)
    clear = where.read(jnp.ones((1, 4)))
    np.testing.assert_array_equal(clear, 1)


@pytest.mark.parametrize("overlapping", [True, False])
def test_a_transmittance_is_read_where_cloud_is_met(overlapping):
    """Where none is, a profile is 1 by itself, and is not searched."""
    own, other = _stretch(0.0, 300.0), _stretch(100.0, 300.0)
    where = place(other, 3, own, numbers(150.0, 250.0)[None], overlapping=overlapping)
    met = where.through(PROFILE, jnp.asarray(True))
    np.testing.assert_array_equal(met, where.read(PROFILE))
    clear = where.through(jnp.ones_like(PROFILE), jnp.asarray(False))
    np.testing.assert_array_equal(clear, jnp.ones_like(met))
