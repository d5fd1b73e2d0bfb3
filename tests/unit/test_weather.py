import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import cloud_classes
from cloudjax.weather.masks import (
    Conditions,
    LatLonGrid,
    MaskGrid,
    cloud_fraction,
    fraction_to_mask,
)


# Table 1 with usual humidities and edges that are narrow beside its intervals.
CLASSES = {
    name: dataclasses.replace(
        cloud.conditions,
        critical_relative_humidity=0.8 if name.startswith("low") else 0.7,
        vertical_wind_width_pa_s=0.01,
        temperature_width_k=1.0,
    )
    for name, cloud in cloud_classes().items()
}
# In the middle of each class: temperature K and omega Pa/s of rising air.
INSIDE = {
    "low_stratus": (275.0, -0.06),
    "low_cumulus": (275.0, -1.0),
    "altostratus": (250.0, -0.06),
    "cirrus": (220.0, -1.0),
}


def hard(conditions):
    return eqx.tree_at(
        lambda c: (c.vertical_wind_width_pa_s, c.temperature_width_k),
        conditions,
        (0.0, 0.0),
    )


def fraction(conditions, humidity, temperature, omega, **kwargs):
    values = jnp.broadcast_arrays(*map(jnp.asarray, (humidity, temperature, omega)))
    return cloud_fraction(conditions, *(v.astype(float) for v in values), **kwargs)


# The decision


def test_the_classes_are_those_of_table_1():
    shells = {k: (c.shell_bottom_m, c.shell_top_m) for k, c in CLASSES.items()}
    assert shells == {
        "low_stratus": (500, 4000),
        "low_cumulus": (0, 6000),
        "altostratus": (6000, 10000),
        "cirrus": (6500, 10000),
    }
    sampled = [c.sampling_altitude_m for c in CLASSES.values()]
    assert sampled == [2000, 2000, 6000, 6000]


@pytest.mark.parametrize("name", CLASSES)
def test_saturated_air_inside_the_conditions_is_overcast(name):
    assert fraction(CLASSES[name], 1.0, *INSIDE[name]) > 0.98
    assert fraction(hard(CLASSES[name]), 1.0, *INSIDE[name]) == 1.0


@pytest.mark.parametrize("name", CLASSES)
@pytest.mark.parametrize("humidity", [0.0, 0.5])
def test_dry_air_is_clear(name, humidity):
    assert fraction(CLASSES[name], humidity, *INSIDE[name]) == 0.0


@pytest.mark.parametrize("name", CLASSES)
def test_sinking_air_is_clear_and_the_sign_is_an_argument(name):
    temperature, omega = INSIDE[name]
    assert fraction(CLASSES[name], 1.0, temperature, -omega) < 0.01
    turned = fraction(CLASSES[name], 1.0, temperature, -omega, omega_sign=1.0)
    assert turned == fraction(CLASSES[name], 1.0, temperature, omega)


@pytest.mark.parametrize(
    ("name", "temperature", "omega"),
    [
        ("low_stratus", 275.0, -0.13),
        ("low_stratus", 233.0, -0.06),
        ("low_cumulus", 275.0, -0.11),
        ("low_cumulus", 275.0, -6.0),
        ("altostratus", 233.0, -0.06),
        ("altostratus", 250.0, -0.13),
        ("cirrus", 233.3, -1.0),
    ],
)
def test_without_widths_every_condition_of_table_1_decides(name, temperature, omega):
    assert fraction(hard(CLASSES[name]), 1.0, temperature, omega) == 0.0


def test_sundqvist_fraction_between_critical_and_saturated():
    humidity = jnp.linspace(0.8, 0.999, 20)
    expected = 1 - np.sqrt((1 - np.asarray(humidity)) / 0.2)
    found = fraction(hard(CLASSES["low_stratus"]), humidity, 275.0, -0.06)
    np.testing.assert_allclose(found, expected, atol=1.1e-3)


def test_neighbouring_classes_share_their_edge():
    """Stratus and cumulus, altostratus and cirrus add up to one across their border."""
    omega = -jnp.linspace(0.08, 0.2, 25)
    low = [
        fraction(CLASSES[n], 1.0, 275.0, omega) for n in ("low_stratus", "low_cumulus")
    ]
    np.testing.assert_allclose(low[0] + low[1], 1.0, atol=1e-3)
    kelvin = jnp.linspace(223.0, 243.0, 25)
    high = [fraction(CLASSES[n], 1.0, kelvin, -0.06) for n in ("altostratus", "cirrus")]
    np.testing.assert_allclose(high[0] + high[1], 1.0, atol=5e-3)


def test_narrow_edges_tend_to_the_hard_decision():
    omega = jnp.asarray([-0.2, -0.121, -0.119, -0.01, 0.01])
    values = []
    for width in (1e-1, 1e-3, 1e-5, 0.0):
        c = eqx.tree_at(
            lambda c: c.vertical_wind_width_pa_s, CLASSES["low_stratus"], width
        )
        values.append(fraction(c, 1.0, 275.0, omega))
    gaps = [float(jnp.abs(v - values[-1]).max()) for v in values]
    assert gaps[0] > gaps[1] > gaps[2]
    assert gaps[2] < 1e-6


@pytest.mark.parametrize("missing", range(3))
def test_missing_weather_is_clear_and_leaves_no_nan_in_gradients(missing):
    inputs = [jnp.asarray([0.95, 0.95]), jnp.full(2, 275.0), jnp.full(2, -0.06)]
    inputs[missing] = inputs[missing].at[0].set(jnp.nan)
    found = cloud_fraction(CLASSES["low_stratus"], *inputs)
    assert found[0] == 0.0
    assert found[1] > 0.4

    def total(*fields):
        return cloud_fraction(CLASSES["low_stratus"], *fields).sum()

    gradients = jax.grad(total, argnums=(0, 1, 2))(*inputs)
    assert all(jnp.all(jnp.isfinite(g)) for g in gradients)


@pytest.mark.parametrize("name", CLASSES)
@pytest.mark.parametrize("harden", [lambda c: c, hard])
def test_gradients_are_finite_on_the_hard_set(name, harden):
    conditions = jax.tree.map(jnp.asarray, harden(CLASSES[name]))
    humidity = jnp.asarray([-0.1, 0.0, 0.7, 0.8, 1.0, 1.1])[:, None, None]
    kelvin = jnp.asarray([0.0, 233.15, 400.0])[None, :, None]
    omega = jnp.asarray([-50.0, -5.99, -0.12, 0.0, 50.0])[None, None, :]
    inputs = [x.astype(float) for x in jnp.broadcast_arrays(humidity, kelvin, omega)]

    def masks(conditions, inputs):
        return fraction_to_mask(cloud_fraction(conditions, *inputs)).sum()

    value, gradients = jax.value_and_grad(masks, argnums=(0, 1))(conditions, inputs)
    assert jnp.isfinite(value)
    for leaf in jax.tree.leaves(gradients):
        assert jnp.all(jnp.isfinite(leaf))


def test_derivatives_agree_with_central_differences():
    with jax.enable_x64(True):
        conditions = jax.tree.map(jnp.asarray, CLASSES["altostratus"])
        point = jnp.asarray([0.85, 234.0, -0.11])

        def mask(x):
            return fraction_to_mask(cloud_fraction(conditions, *x[:, None]))[0]

        steps = 1e-6 * jnp.eye(3)
        differences = [(mask(point + s) - mask(point - s)) / 2e-6 for s in steps]
        np.testing.assert_allclose(
            jax.jit(jax.jacfwd(mask))(point), differences, rtol=1e-6
        )
        np.testing.assert_allclose(
            jax.jit(jax.jacrev(mask))(point), differences, rtol=1e-6
        )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"shell_bottom_m": 5000.0}, "shell_bottom_m must be less"),
        ({"critical_relative_humidity": 80.0}, "fraction"),
        ({"temperature_width_k": -1.0}, "negative"),
    ],
)
def test_impossible_conditions_are_refused(change, message):
    values = {
        k: getattr(CLASSES["low_stratus"], k) for k in Conditions.__dataclass_fields__
    }
    with pytest.raises(ValueError, match=message):
        Conditions(**(values | change))


# The mask


def test_a_mask_makes_a_standard_texture_cover_the_fraction():
    texture = np.random.default_rng(0).standard_normal(200_000)
    for expected in (0.0, 0.1, 0.5, 0.9, 1.0):
        covered = np.mean(texture + float(fraction_to_mask(jnp.asarray(expected))) > 0)
        assert covered == pytest.approx(expected, abs=0.003)


def test_a_mask_is_finite_ordered_and_antisymmetric():
    fractions = jnp.asarray([-1.0, 0.0, 0.3, 0.7, 1.0, 2.0, jnp.nan])
    mask = fraction_to_mask(fractions)
    np.testing.assert_allclose(mask[2], -mask[3], atol=1e-6)
    np.testing.assert_allclose(mask[1], -mask[4], rtol=1e-3)
    assert mask[0] == mask[1] == mask[6] < mask[2] < mask[3] < mask[4] == mask[5]
    slopes = jax.vmap(jax.grad(fraction_to_mask))(fractions)
    assert jnp.all(jnp.isfinite(slopes))
    assert jnp.all(slopes[2:4] > 0)


# Grids


def global_mask(step=10.0):
    lat, lon = np.arange(-90, 90.1, step), np.arange(0, 360, step)
    values = np.random.default_rng(1).random((lat.size, lon.size))
    return MaskGrid.from_fraction(values, lat, lon), values, lat, lon


def test_nodes_are_returned_as_they_are():
    mask, values, lat, lon = global_mask()
    grid = np.meshgrid(lat[1:-1], lon, indexing="ij")
    np.testing.assert_allclose(mask(*grid), fraction_to_mask(values[1:-1]), atol=1e-5)


def test_numpy_and_jax_agree_and_keep_their_precision():
    mask, *_ = global_mask()
    rng = np.random.default_rng(2)
    lat, lon = rng.uniform(-90, 90, (5, 7)), rng.uniform(-400, 400, (5, 7))
    host, device = mask(lat, lon), mask(jnp.asarray(lat), jnp.asarray(lon))
    assert isinstance(host, np.ndarray)
    assert host.dtype == np.float64
    assert isinstance(device, jax.Array)
    np.testing.assert_allclose(host, device, atol=2e-4)


def test_a_traced_mask_accepts_numpy_points():
    mask, *_ = global_mask()
    lat, lon = np.zeros(3), np.ones(3)
    by_mask = jax.grad(lambda m: m(lat, lon).sum())(mask)
    assert float(by_mask.mask.sum()) == pytest.approx(3.0)


def test_the_date_line_is_no_edge():
    mask, *_ = global_mask()
    lat = np.linspace(-90, 90, 37)
    for seam in (0.0, 180.0, 360.0, -180.0):
        east, west = (
            mask(lat, np.full(37, seam + 1e-9)),
            mask(lat, np.full(37, seam - 1e-9)),
        )
        np.testing.assert_allclose(east, west, atol=1e-7)
    np.testing.assert_allclose(mask(lat, lat + 720), mask(lat, lat), atol=1e-7)


@pytest.mark.parametrize("pole", [-90.0, 90.0])
def test_a_pole_has_one_value(pole):
    mask, *_ = global_mask()
    around = mask(np.full(100, pole), np.linspace(-180, 180, 100))
    assert np.ptp(around) < 1e-6
    beyond = mask(np.full(100, 1.1 * pole), np.linspace(-180, 180, 100))
    np.testing.assert_allclose(beyond, around, atol=1e-6)


def test_a_regional_grid_holds_its_edges():
    mask = MaskGrid.from_fraction(
        np.asarray([[0.1, 0.2], [0.3, 0.4]]), [10.0, 20.0], [30.0, 40.0]
    )
    outside = mask(
        np.asarray([0.0, 0.0, 50.0, 50.0]), np.asarray([0.0, 99.0, 0.0, 99.0])
    )
    np.testing.assert_allclose(outside, np.ravel(mask.mask), atol=1e-6)


def test_missing_weather_is_clear_in_a_grid():
    values = np.full((3, 4), 0.5)
    values[1, 2] = np.nan
    mask = MaskGrid.from_fraction(values, [-10, 0, 10], [0, 10, 20, 30])
    assert mask(np.asarray([0.0]), np.asarray([20.0])) == fraction_to_mask(np.zeros(1))
    with pytest.raises(ValueError, match="from_fraction"):
        MaskGrid(jnp.full((3, 4), jnp.nan), mask.grid)


def test_gradients_by_position_are_finite_at_poles_edges_and_seams():
    mask, *_ = global_mask()
    lat = jnp.asarray([-90.0, 90.0, 0.0, 0.0, 5.0])
    lon = jnp.asarray([0.0, 360.0, 180.0, -180.0, 725.0])
    for gradient in jax.grad(lambda *x: mask(*x).sum(), argnums=(0, 1))(lat, lon):
        assert jnp.all(jnp.isfinite(gradient))


@pytest.mark.parametrize(
    ("lat", "lon", "message"),
    [
        ([10, 0], [0, 1], "latitude_deg must ascend"),
        ([0, 1, 3], [0, 1], "equal steps"),
        ([0, np.nan], [0, 1], "ascend"),
        ([0], [0, 1], "at least two"),
        ([80, 100], [0, 1], "within ±90"),
        ([0, 1], np.arange(0, 361, 10), "repeated meridian"),
    ],
)
def test_axes_that_cannot_be_indexed_are_refused(lat, lon, message):
    with pytest.raises(ValueError, match=message):
        LatLonGrid.from_axes(np.asarray(lat, float), np.asarray(lon, float))


def test_a_mask_of_another_shape_is_refused():
    with pytest.raises(ValueError, match="shape"):
        MaskGrid(jnp.zeros((2, 2)), LatLonGrid.from_axes([0, 1, 2], [0, 1]))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("columns", [1440, 1080, 7])
def test_the_circle_is_recognised_in_either_precision(dtype, columns):
    lon = np.linspace(0, 360, columns, endpoint=False).astype(dtype)
    grid = LatLonGrid.from_axes([0, 1], lon)
    assert grid.longitude.periodic
    assert grid.longitude.step == 360 / columns
