"""The march: exact exponentials, whatever the steps and the nodes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import norm

from cloudjax import Latent, Occupancy, Slopes
from cloudjax.march.march import first_surface, march
from tests.helpers import numbers


def _occupancy(fraction, weights=(1.0,)) -> Occupancy:
    fraction = jnp.asarray(fraction, float)
    if fraction.ndim == 2:
        fraction = jnp.broadcast_to(fraction[None], (len(weights), *fraction.shape))
    return Occupancy(fraction, numbers(*weights), None)


@pytest.mark.parametrize("beta", [0.0, 1e-6, 1e-3, 0.05])
def test_a_homogeneous_slab_obeys_beer(beta):
    """T = exp(-βL) to 1e-6, and what is absorbed adds up to 1 - T."""
    length = numbers(0.0, 1.0, 500.0, 3e4)
    passed = march(_occupancy(np.ones((4, 24))), length)
    np.testing.assert_allclose(passed.depth_m[0], length, rtol=1e-6)
    transmittance = np.exp(-beta * np.asarray(length))
    absorbed = np.asarray(passed.absorbed(jnp.asarray(beta)))[0]
    np.testing.assert_allclose(absorbed.sum(-1), 1 - transmittance, atol=1e-6)
    assert np.all(absorbed >= 0)


def test_what_is_absorbed_adds_up_to_what_is_missing():
    rng = np.random.default_rng(0)
    fraction = rng.random((3, 50, 24)) * (rng.random((3, 50, 24)) < 0.4)
    passed = march(_occupancy(fraction, (0.2, 0.5, 0.3)), jnp.full(50, 1e4))
    for beta in (1e-12, 1e-4, 1e-2, 1e4):
        absorbed = passed.absorbed(jnp.asarray(beta))
        missing = -jnp.expm1(-beta * passed.depth_m)
        np.testing.assert_allclose(absorbed.sum(-1), missing, rtol=2e-5, atol=1e-30)


def test_thin_cloud_keeps_its_relative_precision():
    passed = march(_occupancy(np.ones((1, 8))), numbers(1000.0))
    absorbed = passed.absorbed(jnp.asarray(1e-15)).sum()
    assert float(absorbed) == pytest.approx(1e-12, rel=1e-5)


@pytest.mark.parametrize("mode", [jax.jacfwd, jax.jacrev])
def test_deep_cloud_has_no_derivatives(mode):
    """Of an optical depth of 1e5 in its first step, whatever stands behind.

    Where light enters a step was a difference of two lengths: forward derivatives were
    25 times all the light.
    """
    shape = jnp.asarray(np.random.default_rng(0).uniform(-3, 3, (1, 40, 6)), float)

    def absorbed(x):
        # Clear for a while, then deep.
        fraction = jnp.where(shape < -2, 0.0, jnp.exp(6 * shape * x))
        return march(_occupancy(fraction), jnp.full(40, 1e4)).absorbed(
            jnp.asarray(30.0)
        )

    np.testing.assert_allclose(jax.jit(mode(absorbed))(jnp.asarray(0.37)), 0, atol=1e-6)


def test_a_step_absorbs_what_those_before_it_leave():
    passed = march(_occupancy([[0.0, 1.0, 0.5, 0.0]]), numbers(400.0))
    np.testing.assert_allclose(passed.segment_m[0, 0], [0, 100, 50, 0])
    np.testing.assert_allclose(passed.cloud_m[0, 0], [0, 100, 150, 150])
    expected = [0, 1 - np.exp(-1), np.exp(-1) * (1 - np.exp(-0.5)), 0]
    absorbed = passed.absorbed(jnp.asarray(0.01))[0, 0]
    np.testing.assert_allclose(absorbed, expected, atol=1e-7)


def test_steps_converge_at_second_order_for_a_smooth_cloud():
    """Of a cloud sin² thick along the ray, the depth is half the chord."""

    def depth(steps, phase):
        s = (np.arange(steps) + 0.5) / steps
        fraction = np.exp(-((s - phase) ** 2) / 0.05)
        return float(march(_occupancy(fraction[None]), numbers(1.0)).depth_m[0, 0])

    with jax.enable_x64(True):
        truth = depth(4096, 0.2)
        errors = [abs(depth(steps, 0.2) - truth) for steps in (8, 16, 32)]
    ratios = np.array(errors[:-1]) / errors[1:]
    np.testing.assert_allclose(ratios, 4, rtol=0.1)


def test_the_mean_is_over_the_structures_with_their_weights():
    fraction = np.stack([np.zeros((2, 4)), np.ones((2, 4))])
    passed = march(_occupancy(fraction, (0.25, 0.75)), numbers(10.0, 20.0))
    np.testing.assert_allclose(passed.mean(passed.depth_m), [7.5, 15.0])


@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_nodes_of_gauss_and_hermite_have_the_moments_of_a_gaussian(count):
    nodes, weights = _float64(Latent.gauss_hermite(count))
    moments = [(weights * nodes**k).sum() for k in range(2 * min(count, 3))]
    np.testing.assert_allclose(moments, [1, 0, 1, 0, 3, 0][: len(moments)], atol=1e-5)


@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_nodes_of_equal_shares_are_the_means_of_shares(count):
    nodes, weights = _float64(Latent.equal_shares(count))
    draws = np.sort(np.random.default_rng(0).normal(size=30_000 * count))
    means = draws.reshape(count, -1).mean(axis=1)
    np.testing.assert_allclose(nodes, means, atol=0.02)
    np.testing.assert_allclose(weights, 1 / count, rtol=1e-6)


@pytest.mark.parametrize("count", [3, 5, 9])
def test_equal_shares_see_edges_of_thick_cloud_best(count):
    """The mean of 1 - exp(-τΦ((v + x) / w)), τ from 0.1 to 100 and w from 0.05 to 3."""
    random = np.random.default_rng(0)
    depth = 10 ** random.uniform(-1, 2, 2000)
    width = 10 ** random.uniform(-1.3, 0.5, 2000)
    value = random.uniform(-2.5, 2.5, 2000)

    def mean(nodes, weights):
        cover = norm.cdf((value[:, None] + nodes) / width[:, None])
        return (1 - np.exp(-depth[:, None] * cover)) @ weights

    fine = np.linspace(-6, 6, 1001)
    truth = mean(fine, norm.pdf(fine) / norm.pdf(fine).sum())
    ours = mean(*_float64(Latent.equal_shares(count))) - truth
    theirs = mean(*_float64(Latent.gauss_hermite(count))) - truth
    assert ours.std() < 0.7 * theirs.std()
    assert abs(ours.mean()) < 0.004


def _float64(latent: Latent) -> tuple[np.ndarray, np.ndarray]:
    return np.asarray(latent.nodes, float), np.asarray(latent.weights, float)


def test_the_transmittance_starts_at_one_and_is_the_mean_of_the_structures():
    fraction = np.stack([np.zeros((1, 2)), np.ones((1, 2))])
    passed = march(_occupancy(fraction, (0.25, 0.75)), numbers(200.0))
    found = passed.transmittance(jnp.asarray(0.01))
    expected = [1, 0.25 + 0.75 * np.exp(-1), 0.25 + 0.75 * np.exp(-2)]
    np.testing.assert_allclose(found[0], expected, rtol=1e-6)


def _surface(absorbed, gradient, slope_variance=0.0, direction=(0.0, 0.0, -1.0)):
    absorbed = jnp.asarray(absorbed, float)[None, None]
    steps = absorbed.shape[-1]
    distance = (jnp.arange(steps, dtype=float) + 0.5)[None] * 10
    up = jnp.broadcast_to(numbers(0, 0, 1)[:, None, None], (3, 1, steps))
    along = jnp.asarray(gradient, float).T[:, None]
    slopes = Slopes(along, jnp.zeros((1, steps)), up, numbers(slope_variance))
    return first_surface(absorbed, distance, slopes, numbers(*direction)[None])


def test_the_first_surface_is_where_all_light_stops():
    gradient = np.zeros((4, 3))
    gradient[2] = [-3e-4, 0, -4e-4]
    surface = _surface([0, 0, 1.0, 0], gradient)
    assert float(surface.distance_m[0, 0]) == pytest.approx(25.0)
    np.testing.assert_allclose(surface.normal[:, 0, 0], [0.6, 0, 0.8], atol=1e-5)


def test_the_first_surface_of_haze_is_its_middle():
    surface = _surface(np.full(4, 0.1), np.tile([0, 1e-4, 0], (4, 1)))
    assert float(surface.distance_m[0, 0]) == pytest.approx(20.0)
    np.testing.assert_allclose(surface.normal[:, 0, 0], [0, -1, 0], atol=1e-4)


def test_slopes_at_few_points_are_linear_in_between():
    """8 steps and 2 points, of which each has the steps of its half, and of the other
    those between the two."""
    weights = np.array([0, 0, 0, 0.5, 0, 0, 0, 0.5])
    gradient = jnp.asarray([[[1e-4, -3e-4]], [[0, 0]], [[0, 0]]], float)
    rise = jnp.asarray([[0, 0, 0, 4e-4, 0, 0, 0, 0]], float)
    up = jnp.broadcast_to(numbers(0, 0, 1)[:, None, None], (3, 1, 2))
    surface = first_surface(
        jnp.asarray(weights, float)[None, None],
        jnp.arange(8.0)[None],
        Slopes(gradient, rise, up, numbers(0.0)),
        numbers(0, 0, -1)[None],
    )
    # Step 3 is three eighths of the way from the first point to the second.
    first = 0.5 * (1e-4 + 3 / 8 * -4e-4) + 0.5 * -3e-4
    expected = [-first, 0, -0.5 * 4e-4 + 1e-9]
    np.testing.assert_allclose(surface.slope[:, 0, 0], expected, rtol=1e-3, atol=1e-10)


def test_where_the_cloud_function_is_flat_the_vertical_decides():
    surface = _surface([0.5, 0.5], np.zeros((2, 3)))
    np.testing.assert_allclose(surface.normal[:, 0, 0], [0, 0, 1], atol=1e-5)


@pytest.mark.parametrize("variance", [0.0, 1e-8])
def test_clear_air_has_finite_surfaces(variance):
    surface = _surface(np.zeros(4), np.zeros((4, 3)), variance)
    assert jnp.isfinite(surface.distance_m).all()
    assert jnp.isfinite(surface.normal).all()
    for light in surface.illumination(numbers(0, 0, 1)[None]):
        assert jnp.isfinite(light).all()


@pytest.mark.parametrize("zenith", [0.0, 50.0, 89.0, 91.0, 170.0])
def test_a_smooth_surface_is_lit_by_the_cosine(zenith):
    """Straight from above, on a slope of 3:4; the floor of the spread is 1e-4."""
    θ = np.radians(zenith)
    sun = np.array([np.sin(θ), 0, np.cos(θ)])
    surface = _surface([1.0], [[-3e-4, 0, -4e-4]])
    lit, shaded = surface.illumination(numbers(*sun)[None])
    cosine = 0.6 * sun[0] + 0.8 * sun[2]
    assert float(lit[0, 0]) == pytest.approx(max(cosine, 0), abs=1e-4)
    assert float(shaded[0, 0]) == pytest.approx(max(-cosine, 0), abs=1e-4)


# Rough surfaces ----------------------------------------------------------------------

TILTS = {"level": (0.0, 0, 1.0), "aslant": (0.6, 0, 0.8), "wall": (0.96, 0, 0.28)}
# Deviation of each component of the slope over the mean slope.
ROUGHNESS = [0.1, 0.5, 1.0, 3.0]
VIEWS = ((0.0, 0.0, -1.0), (0.8, 0.0, -0.6))
# Without those that turn away from the viewer by more than a deviation: a ray does not
# meet the back side of a cloud first.
ROUGH = [
    pytest.param(tilt, roughness, view, id=f"{name}-{roughness}-{view}")
    for name, tilt in TILTS.items()
    for roughness in ROUGHNESS
    for view in VIEWS
    if np.dot(tilt, view) < roughness
]


def _drawn(mean, roughness, direction, count=200_000):
    """Outward slopes that a ray along `direction` meets, and how often it meets each.

    The ray enters cloud where CF rises along it, the more often the steeper it rises.
    """
    draws = np.random.default_rng(0).normal(size=(count, 3))
    slopes = np.asarray(mean) + roughness * draws
    return slopes, np.maximum(-(slopes @ np.asarray(direction)), 0)


@pytest.mark.parametrize(("tilt", "roughness", "direction"), ROUGH)
def test_the_mean_slope_is_that_of_what_a_ray_meets(tilt, roughness, direction):
    """Exact for a normal distribution: against 2e5 draws, weighted by their rise."""
    slopes, weights = _drawn(tilt, roughness, direction)
    surface = _surface(
        [1.0], [-1e-4 * np.asarray(tilt)], (1e-4 * roughness) ** 2, direction
    )
    expected = np.average(slopes, axis=0, weights=weights)
    found = np.asarray(surface.slope[:, 0, 0]) / 1e-4
    np.testing.assert_allclose(found, expected, atol=0.02 * max(1, roughness))


@pytest.mark.parametrize(("tilt", "roughness", "direction"), ROUGH)
def test_a_rough_surface_is_lit_as_the_mean_of_its_parts(tilt, roughness, direction):
    """Against 2e5 draws for suns of all heights.

    The closed form takes the root mean square of the slope for the length of each, and
    leaves the rise as spread as it was without the ray: an approximation. Measured, the
    largest error of a cosine is 0.005 at a roughness of a tenth and 0.063 above, the
    root mean square over all suns 0.036.
    """
    slopes, weights = _drawn(tilt, roughness, direction)
    surface = _surface(
        [1.0], [-1e-4 * np.asarray(tilt)], (1e-4 * roughness) ** 2, direction
    )
    normals = slopes / np.linalg.norm(slopes, axis=-1, keepdims=True)
    errors = []
    for zenith in np.radians([0, 40, 80, 120]):
        for azimuth in np.radians([0, 90, 180]):
            sun = np.array(
                [
                    np.sin(zenith) * np.cos(azimuth),
                    np.sin(zenith) * np.sin(azimuth),
                    np.cos(zenith),
                ]
            )
            cosine = normals @ sun
            for found, part in zip(
                surface.illumination(numbers(*sun)[None]),
                (np.maximum(cosine, 0), np.maximum(-cosine, 0)),
                strict=True,
            ):
                expected = np.average(part, weights=weights)
                errors.append(float(found[0, 0]) - expected)
    assert np.abs(errors).max() < (0.02 if roughness < 0.2 else 0.07)
    assert np.sqrt(np.mean(np.square(errors))) < 0.04
