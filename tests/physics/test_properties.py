"""What holds anywhere in the domain: drawn scenes, drawn views.

A draw is a vector of all parameters of a scene and one ray with its sun. Hypothesis
draws the seeds of batches of them, so that one compiled function serves all draws. The
slow tier has 10 000 draws of scenes with every part of the model. What was largest of
all draws is told by `--hypothesis-show-statistics` (docs/accuracy/extremes.md).
"""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings, target
from hypothesis import strategies as st

from cloudjax import (
    EmissiveBands,
    PlaneParallel,
    Shell,
    StandardAtmosphere,
    bands_named,
    look,
    radiances,
    render,
)
from cloudjax.light.phase import HenyeyGreenstein
from tests.extreme_scenes import EVERYTHING, Kind, Seen, radiance_from, seen_from
from tests.extreme_views import drawn, drawn_scene


SIMPLE = Kind()
BATCH = 64
SEEDS = st.integers(0, 2**32 - 1)


def draws(count: int):
    """So many draws, the same in each run; a failing seed is not searched for a simpler
    one, for all are as simple."""
    return settings(
        max_examples=-(-count // BATCH),
        derandomize=True,
        deadline=None,
        database=None,
        phases=(Phase.explicit, Phase.generate),
        suppress_health_check=[HealthCheck.too_slow],
    )


def note(values: np.ndarray, what: str) -> float:
    """The largest of some values, which the statistics of Hypothesis show."""
    largest = float(values.max())
    target(largest, label=what)
    return largest


def _batch(kind: Kind, seed: int, above: bool = False):
    return drawn(kind, np.random.default_rng(seed), BATCH, above)


def reference(kind: Kind) -> np.ndarray:
    """A radiance of each band that is large: a white surface, a black body of 300 K."""
    bands = bands_named(*kind.sunlit), bands_named(*kind.thermal)
    white = [float(b.solar_irradiance or 0) / np.pi for b in bands[0]]
    emissive = EmissiveBands.of(bands[1])
    assert emissive is not None
    black = np.asarray(emissive.planck(jnp.full(1, 300.0)))[:, 0]
    return np.array([*white, *black])


def assert_sound(kind: Kind, seen: Seen) -> None:
    """Finite, and light is lost and not made."""
    for name, part in zip(seen._fields, seen, strict=True):
        broken = np.flatnonzero(~np.isfinite(part).reshape(len(part), -1).all(1))
        assert not broken.size, f"{name} of draws {broken}"
    assert seen.through.min() >= 0
    assert seen.through.max() <= 1 + 1e-6
    assert np.diff(seen.through, axis=-1).max() <= 1e-6
    assert seen.cover.min() >= 0
    assert seen.cover.max() <= 1
    assert seen.depth.min() >= 0
    assert (seen.radiance / reference(kind)[None]).min() > -1e-5


def modes_apart(kind: Kind, seen: Seen) -> np.ndarray:
    """By how much forward and reverse derivatives differ, of the largest one."""
    by_forward, by_reverse = seen.forward.sum(-1), seen.reverse.sum(-1)
    scale = np.abs(seen.reverse).max(-1) + 1e-3 * reference(kind).max()
    return np.abs(by_forward - by_reverse) / scale


# Finite ------------------------------------------------------------------------------


@draws(320)
@given(seed=SEEDS)
def test_values_and_derivatives_are_finite(seed):
    seen = seen_from(SIMPLE, *_batch(SIMPLE, seed))
    assert_sound(SIMPLE, seen)
    assert note(modes_apart(SIMPLE, seen), "modes, of the largest derivative") < 5e-3


@pytest.mark.slow
@draws(10_000)
@given(seed=SEEDS)
def test_values_and_derivatives_of_everything_are_finite(seed):
    assert_sound(EVERYTHING, seen_from(EVERYTHING, *_batch(EVERYTHING, seed)))


# Clouds of an optical depth of millions begin where a hundred-millionth of a step is
# cloud, which rounding decides. So few draws of everything may be off by more.
OFF = 1 / 200


@pytest.mark.slow
def test_both_modes_agree_in_everything():
    """10 048 draws. Measured: 3 differ by more, of depths of 2 and 67 million and of
    nearly none.
    """
    apart = [
        modes_apart(EVERYTHING, seen_from(EVERYTHING, *_batch(EVERYTHING, seed)))
        for seed in range(157)
    ]
    assert np.mean(np.concatenate(apart) > 5e-3) < OFF / 10


# Single precision --------------------------------------------------------------------

# Of a white surface, and of a black body of 300 K. The worst are clouds of an optical
# depth of millions: they begin where a hundred-millionth of a step is cloud.
SUNLIT_ERROR, THERMAL_ERROR = 1e-3, 2e-2


def _difference(kind: Kind, seed: int) -> np.ndarray:
    """Between both precisions, relative to `reference`, [rays bands]."""
    # With its derivatives, for which it is compiled anyway.
    single = seen_from(kind, *_batch(kind, seed)).radiance
    with jax.enable_x64(True):
        double = radiance_from(kind, *_batch(kind, seed))
    assert single.dtype == np.float32
    assert double.dtype == np.float64
    return np.abs(single - double) / reference(kind)[None]


def _assert_little_off(kind: Kind, off: np.ndarray) -> None:
    sunlit = len(kind.sunlit)
    assert note(off[:, :sunlit], "of a white surface") < SUNLIT_ERROR
    assert note(off[:, sunlit:], "of a black body of 300 K") < THERMAL_ERROR


def _assert_precise(kind: Kind, seed: int) -> None:
    _assert_little_off(kind, _difference(kind, seed))


def _assert_few_off(off: list[np.ndarray]) -> None:
    """Of everything, in each of many batches."""
    found, sunlit = np.concatenate(off), len(EVERYTHING.sunlit)
    assert np.mean(found[:, :sunlit].max(1) > SUNLIT_ERROR) < OFF
    assert np.mean(found[:, sunlit:].max(1) > THERMAL_ERROR) < OFF


@draws(320)
@given(seed=SEEDS)
def test_single_precision_agrees_with_double(seed):
    _assert_precise(SIMPLE, seed)


@pytest.mark.slow
def test_single_precision_agrees_with_double_in_everything():
    """10 048 draws. Measured: 24 differ by more."""
    _assert_few_off([_difference(EVERYTHING, seed) for seed in range(157)])


# Energy ------------------------------------------------------------------------------


def _set(kind: Kind, parts: np.ndarray, **values: float) -> np.ndarray:
    names, parts = list(kind.ranges), parts.copy()
    for name, value in values.items():
        parts[:, names.index(name)] = kind.ranges[name].part(value)
    return parts


def _values(kind: Kind, parts: np.ndarray, name: str):
    return kind.ranges[name].at(
        jnp.asarray(parts[:, list(kind.ranges).index(name)], float)
    )


def _along(kind: Kind, name: str) -> np.ndarray:
    """The tangent of one parameter, per e-fold of a logarithmic one."""
    tangents = np.zeros((BATCH, len(kind.ranges)))
    span = kind.ranges[name]
    tangents[:, list(kind.ranges).index(name)] = 1 / np.log(span.high / span.low)
    return tangents


@jax.jit
@jax.vmap
def _sent_back(depth, g, sun):
    """Reflectance of a white slab, summed over all directions by a quadrature."""
    nodes, weights = np.polynomial.legendre.leggauss(24)
    view, azimuth = (nodes + 1) / 2, (np.arange(96) + 0.5) / 96 * np.pi
    view = jnp.repeat(jnp.asarray(view, float), azimuth.size)
    sines = jnp.sqrt((1 - sun**2) * (1 - view**2))
    scattering = sines * np.tile(np.cos(azimuth), nodes.size) - sun * view
    slab = depth * jnp.ones_like(view), jnp.zeros(()), HenyeyGreenstein(g)
    networks = PlaneParallel.load()
    factor = networks.reflectance(*slab, sun * jnp.ones_like(view), view, scattering)
    over_azimuth = factor.reshape(nodes.size, -1).mean(1)
    return (over_azimuth * (weights * (nodes + 1) / 2)).sum()


def _assert_no_more_is_sent_back(seed: int) -> None:
    """From all depths, though a ray may be brighter than white: low suns are seen at
    3.4 times that through thin edges of cloud that scatter forward.
    """
    rng = np.random.default_rng(seed)
    depth = np.exp(rng.uniform(np.log(0.01), np.log(1e6), BATCH))
    g, sun = rng.uniform(0, 0.9, BATCH), rng.uniform(0.05, 1, BATCH)
    sent = _sent_back(*(jnp.asarray(x, float) for x in (depth, g, sun)))
    assert note(sent, "sent back") < 1.02


@draws(640)
@given(seed=SEEDS)
def test_a_white_slab_sends_back_no_more_than_it_gets(seed):
    _assert_no_more_is_sent_back(seed)


@pytest.mark.slow
@draws(10_000)
@given(seed=SEEDS)
def test_no_white_slab_sends_back_more_than_it_gets(seed):
    _assert_no_more_is_sent_back(seed)


WARM_GROUND = {"ground_k": 335.0, "emissivity": 1.0}
ABSORBING = Kind(sunlit=(), scatters=False)


def _assert_between_coldest_and_warmest(seed: int) -> None:
    """Clouds that only absorb are over black ground, in air that cools upwards."""
    parts, view = _batch(ABSORBING, seed, above=True)
    parts = _set(ABSORBING, parts, emissivity=1.0)
    (shell,) = ABSORBING.shells
    air = StandardAtmosphere()(jnp.asarray([shell.bottom_m, shell.top_m]))
    offset, ground = (_values(ABSORBING, parts, n) for n in ("offset_k", "ground_k"))
    kelvin = jnp.stack([air[0] + offset, air[1] + offset, ground])
    band = EmissiveBands.of(bands_named(*ABSORBING.thermal))
    assert band is not None
    planck = np.asarray(band.planck(kelvin))[0]
    seen = radiance_from(ABSORBING, parts, view)[:, 0]
    hit = np.asarray(view.around.ground.hit)
    assert hit.mean() > 0.5
    slack = 1e-4 * reference(ABSORBING)[0]
    assert (seen <= planck.max(0) + slack).all()
    assert (seen >= np.where(hit, planck.min(0), 0) - slack).all()


@draws(320)
@given(seed=SEEDS)
def test_thermal_radiance_is_between_the_coldest_and_the_warmest(seed):
    _assert_between_coldest_and_warmest(seed)


@pytest.mark.slow
@draws(10_000)
@given(seed=SEEDS)
def test_no_thermal_radiance_is_beyond_the_coldest_and_the_warmest(seed):
    _assert_between_coldest_and_warmest(seed)


# Extinction --------------------------------------------------------------------------


def _assert_no_brighter_infrared(seed: int) -> None:
    """Cold cloud is over ground that is warmer than all air, seen from above.

    Where nothing changes any more, the emulated emissivity ripples: by less than 1e-3
    of a black body of 300 K for each e-fold of extinction.
    """
    parts, view = _batch(SIMPLE, seed, above=True)
    parts = _set(SIMPLE, parts, **WARM_GROUND)
    tangents = _along(SIMPLE, "extinction_per_m")
    gained = seen_from(SIMPLE, parts, view, tangents).forward[:, 1]
    assert note(gained / reference(SIMPLE)[1], "of a black body of 300 K") < 1e-3


@draws(320)
@given(seed=SEEDS)
def test_more_extinction_never_brightens_the_infrared_of_a_cold_cloud(seed):
    _assert_no_brighter_infrared(seed)


@pytest.mark.slow
@draws(10_000)
@given(seed=SEEDS)
def test_more_extinction_brightens_the_infrared_of_no_cold_cloud(seed):
    _assert_no_brighter_infrared(seed)


def _assert_no_darker_visible(seed: int) -> None:
    """White cloud is over black ground, thicker than an optical depth of 3.

    Saturated, the emulated reflectance ripples: by less than 2e-3 of what is seen for
    each e-fold of extinction.
    """
    parts, view = _batch(SIMPLE, seed, above=True)
    parts = _set(SIMPLE, parts, absorption=0.0, albedo=0.0)
    tangents = _along(SIMPLE, "extinction_per_m")
    seen = seen_from(SIMPLE, parts, view, tangents)
    thick = seen.depth > 3
    bright = seen.radiance[:, 0] + 1e-3 * reference(SIMPLE)[0]
    assert note(-(seen.forward[:, 0] / bright)[thick], "of what is seen") < 2e-3


@draws(320)
@given(seed=SEEDS)
def test_more_extinction_never_darkens_the_visible_of_a_thick_cloud(seed):
    _assert_no_darker_visible(seed)


@pytest.mark.slow
@draws(10_000)
@given(seed=SEEDS)
def test_more_extinction_darkens_the_visible_of_no_thick_cloud(seed):
    _assert_no_darker_visible(seed)


# Order -------------------------------------------------------------------------------


@draws(192)
@given(seed=SEEDS)
def test_the_order_of_pixels_does_not_matter(seed):
    parts, view = _batch(SIMPLE, seed)
    order = np.random.default_rng(seed).permutation(BATCH)
    seen = seen_from(SIMPLE, parts, view).radiance
    turned = seen_from(SIMPLE, parts[order], view[order]).radiance
    np.testing.assert_allclose(turned, seen[order], rtol=1e-5, atol=1e-5)


# Of most rays, relative to `reference`: float32. A few see deep clouds, which begin
# where rounding decides.
ROUNDED = 1e-5
LAYERS = Kind(shells=(Shell(0.0, 6e3), Shell(4e3, 14e3)))


def _assert_rounded(kind: Kind, off: np.ndarray) -> None:
    assert np.median(off.max(1)) < ROUNDED
    _assert_little_off(kind, off)


def _off_by_order(kind: Kind, seed: int) -> np.ndarray:
    """How far radiances are from those of the layers in the opposite order."""
    there, back = (
        radiance_from(one, *_batch(one, seed))
        for one in (kind, replace(kind, backwards=True))
    )
    return np.abs(back - there) / reference(kind)[None]


@draws(320)
@given(seed=SEEDS)
def test_the_order_of_layers_does_not_matter(seed):
    _assert_rounded(LAYERS, _off_by_order(LAYERS, seed))


@pytest.mark.slow
def test_the_order_of_layers_does_not_matter_in_everything():
    """10 048 draws."""
    _assert_few_off([_off_by_order(EVERYTHING, seed) for seed in range(157)])


# Of fewer than 16, which are compiled for one size each.
TILES = 7, 15


def _off_by_tile(kind: Kind, seed: int) -> np.ndarray:
    """How far renders by tiles are from the pure function."""
    scene, rays, sun = drawn_scene(kind, np.random.default_rng(seed), BATCH)
    seen = [radiances(scene, look(scene, rays, sun))]
    seen += [render(scene, rays, sun, tile=tile).radiances for tile in TILES]
    pure, *tiled = (np.concatenate(jax.tree.leaves(one)).T for one in seen)
    return np.abs(np.array(tiled) - pure).max(0) / reference(kind)[None]


@draws(640)
@given(seed=SEEDS)
def test_the_size_of_tiles_does_not_matter(seed):
    """Ten scenes of 64 rays."""
    _assert_rounded(SIMPLE, _off_by_tile(SIMPLE, seed))


@pytest.mark.slow
def test_the_size_of_tiles_does_not_matter_in_everything():
    """157 scenes of 64 rays."""
    _assert_few_off([_off_by_tile(EVERYTHING, seed) for seed in range(157)])
