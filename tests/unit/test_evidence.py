"""Covers of layers, from what an analysis has, divided among classes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax.weather.evidence import (
    Evidence,
    Window,
    ascent_factor,
    condensate_cover,
    humidity_cover,
    inversion_cover,
    left_by,
    shared,
)


def test_independent_parts_make_the_cover():
    rng = np.random.default_rng(0)
    cover, weights = rng.uniform(0, 0.99, 50), rng.uniform(0, 1, (3, 50))
    parts = np.stack(shared(cover, list(weights)))
    np.testing.assert_allclose(1 - np.prod(1 - parts, axis=0), cover, atol=1e-5)
    first, last = shared(np.array([0.6]), [np.array([1.0]), np.array([0.0])])
    assert first == pytest.approx(0.6, abs=1e-3)
    assert last < 1e-3


def test_what_is_claimed_and_what_is_left_make_the_cover():
    cover, claimed = np.array([0.5, 0.5, 0.2, 1.0]), np.array([0.0, 0.3, 0.2, 1.0])
    left = np.asarray(left_by(cover, claimed))
    np.testing.assert_allclose(1 - (1 - left) * (1 - claimed), cover, atol=1e-6)
    assert left_by(np.array([0.1]), np.array([0.3])) == 0


def test_shares_have_slopes_at_the_ends():
    slope = jax.jacfwd(lambda c: shared(c, [jnp.asarray(0.3), jnp.asarray(0.7)])[0])
    for cover in (0.0, 0.5, 1.0):
        assert np.isfinite(slope(jnp.asarray(cover)))


def test_a_window_is_half_open_at_its_edges():
    window = Window("inversion_k", above=4.0, below=10.0, width=0.5)
    found = np.asarray(window(np.array([-50.0, 4.0, 7.0, 10.0, 50.0])))
    np.testing.assert_allclose(found, [0, 0.5, 1, 0.5, 0], atol=0.01)
    other = Window("inversion_k", below=4.0, width=0.5)
    edge = np.linspace(2.0, 6.0, 9)
    np.testing.assert_allclose(window(edge) + other(edge), 1.0, atol=0.01)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: Window("moisture"),
        lambda: Window("inversion_k", above=2.0, below=1.0),
        lambda: Window("inversion_k", width=0.0),
        lambda: Evidence("upper"),
        lambda: Evidence("low", claims="rain"),
    ],
)
def test_evidence_that_makes_no_sense_is_refused(wrong):
    with pytest.raises(ValueError, match=r"must|There is no"):
        wrong()


def test_condensate_covers_more_in_humid_air():
    """Xu & Randall by hand: RH 0.9, q_s 10 g/kg, q_c 0.1 g/kg."""
    by_hand = 0.9**0.25 * (1 - np.exp(-100 * 1e-4 / (0.1 * 1e-2) ** 0.49))
    humidity = np.array([0.9, 0.5, 0.9, 1.0])
    water = np.array([1e-4, 1e-4, 0.0, 1e-4])
    found = np.asarray(condensate_cover(humidity, np.full(4, 1e-2), water))
    assert found[0] == pytest.approx(by_hand, rel=1e-5)
    assert found[1] < 0.6 * by_hand
    assert found[2] == 0
    assert found[3] > 0.9


def test_slingo_wants_humidity_ascent_or_an_inversion():
    humid = humidity_cover(np.array([0.8, 0.9, 1.0]))
    np.testing.assert_allclose(humid, [0, 0.25, 1], atol=1e-6)
    rising = ascent_factor(np.array([0.1, -0.05, -1.0]))
    np.testing.assert_allclose(rising, [0, 0.5, 1], atol=1e-6)
    stable = inversion_cover(np.array([0.05, 0.175, 0.175]), np.array([0.9, 0.9, 0.7]))
    np.testing.assert_allclose(stable, [0, 0.5, 0.25], atol=1e-3)
