"""Coarse fields make clouds thicker here and higher there, and smoother elsewhere."""

from dataclasses import replace
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import CoarseFields, FractalCloud, LatLonGrid, Response, Shell
from cloudjax.clouds.class_files import class_table, classes_from
from cloudjax.geometry.shells import chords
from tests.helpers import (
    GEOSTATIONARY_M,
    FunctionMask,
    fractal_cloud,
    ground_points,
    rays_to,
    sampling,
)


RAYS = rays_to(GEOSTATIONARY_M, ground_points(40, 20.0, 10.0, 0.4))
STEPS = 12


def _cloud(fields: CoarseFields | None = None, **changes: Any) -> FractalCloud:
    cloud = replace(
        fractal_cloud(Shell(1000.0, 4000.0), nodes=3, base_m=2000.0, top_m=2600.0),
        mask=FunctionMask(lambda φ, λ: 0.3 + 0 * φ),
        fields=fields,
    )
    return replace(cloud, function=replace(cloud.function, **changes))


def _uniform(depth=0.0, top_m=0.0, roughness=0.0) -> CoarseFields:
    axes = np.array([10.0, 30.0]), np.array([0.0, 20.0])
    nodes = np.broadcast_to([depth, top_m, roughness], (2, 2, 3))
    return CoarseFields(jnp.asarray(nodes), LatLonGrid.from_axes(*axes))


@eqx.filter_jit
def _occupied(cloud, way):
    samples = cloud.sample(way, cloud.make_textures(), steps=STEPS, slopes=True)
    found = cloud.occupancy(samples, STEPS)
    return found, cloud.likelihood(samples)


def _found(cloud: FractalCloud):
    chord = chords(RAYS, cloud.shell)
    return _occupied(cloud, cloud.navigate(RAYS, chord, sampling()))


def _assert_alike(one, other, factor=1.0):
    (one, chance), (other, same) = one, other
    assert 0.02 < float(one.fraction.mean()) < 3
    np.testing.assert_allclose(one.fraction, factor * other.fraction, atol=2e-5)
    np.testing.assert_allclose(chance, same, rtol=2e-4)
    for name in ("gradient", "rise", "unresolved"):
        a, b = (getattr(x.slopes, name) for x in (one, other))
        np.testing.assert_allclose(a, b, rtol=1e-4, atol=1e-9)


def test_fields_of_nothing_change_nothing():
    _assert_alike(_found(_cloud(_uniform())), _found(_cloud()))


def test_depth_multiplies_the_extinction():
    _assert_alike(_found(_cloud(_uniform(depth=np.log(2.0)))), _found(_cloud()), 2.0)


def test_tops_move_both_barriers():
    plain = _cloud(base_m=jnp.asarray(2300.0), top_m=jnp.asarray(2900.0))
    _assert_alike(_found(_cloud(_uniform(top_m=300.0))), _found(plain))


def test_roughness_multiplies_textures_mask_and_what_they_must_exceed():
    """Of a margin M = 2 exp(-(z_t - z_b)/2h) + T twice as much: T + M for T."""
    f = _cloud().function
    barriers = 2 * np.exp(-(f.top_m - f.base_m) / (2 * f.barrier_scale_m))
    twice: dict[str, Any] = {
        "weights": 2 * f.weights,
        "mask_gain": 2 * f.mask_gain,
        "threshold": 2 * f.threshold + barriers,
    }
    rough = _found(_cloud(_uniform(roughness=np.log(2.0))))
    occupancy, _ = _found(_cloud(**twice))
    # As many clouds as without the fields.
    _, chance = _found(_cloud())
    _assert_alike(rough, (occupancy, chance))


def test_clouds_follow_as_strongly_as_they_respond():
    fields = _uniform(0.7, 300.0, 0.4)
    none = Response(*(jnp.asarray(0.0) for _ in range(3)))
    _assert_alike(_found(replace(_cloud(fields), response=none)), _found(_cloud()))
    half = Response(*(jnp.asarray(0.5) for _ in range(3)))
    expected = _found(_cloud(_uniform(0.35, 150.0, 0.2)))
    _assert_alike(_found(replace(_cloud(fields), response=half)), expected)


def test_fields_are_read_where_the_rays_are():
    """Optical depth rises by e per degree to the north: so do the rays' own parts."""
    axes = np.linspace(18.0, 22.0, 9), np.linspace(8.0, 12.0, 9)
    north = (axes[0] - 20.0)[:, None] * np.ones(9)
    nodes = jnp.asarray(np.stack([north, 0 * north, 0 * north], axis=-1))
    fields = CoarseFields(nodes, LatLonGrid.from_axes(*axes))
    some, plain = _found(_cloud(fields))[0].fraction, _found(_cloud())[0].fraction
    cloudy = np.asarray(plain.sum((0, 2)) > 0.1)
    ratio = np.asarray(some.sum((0, 2)) / plain.sum((0, 2)))[cloudy]
    ground, _ = RAYS.ground()
    # 2.5 km above the ground, seen aslant: some hundredths of a degree to the south.
    expected = np.exp(ground.latitude_deg[cloudy] - 20.0)
    np.testing.assert_allclose(ratio, expected, rtol=0.03)
    assert ratio.max() / ratio.min() > 1.3


def test_extinction_grows_into_the_cloud():
    """exp(κ CF) of the hard level set; nothing outside of it."""
    plain = _cloud(smoothing=jnp.asarray(1e-3))
    grown = replace(plain, extinction_growth=jnp.asarray(0.5))
    one, other = (_found(c)[0].fraction for c in (grown, plain))
    ratio = np.asarray(one / other)[np.asarray(other) > 0.5]
    assert ratio.min() >= 1
    assert 1.1 < ratio.max() < np.exp(0.5 * 4)
    np.testing.assert_allclose(one[other < 0.01], other[other < 0.01], atol=0.01)


def test_fields_must_be_finite_and_of_their_grid():
    with pytest.raises(ValueError, match="finite"):
        _uniform(depth=np.nan)
    with pytest.raises(ValueError, match="shape"):
        CoarseFields(jnp.zeros((3, 2, 3)), _uniform().grid)


def test_classes_keep_what_they_respond_in_their_files():
    from cloudjax import imagery_classes

    one = replace(
        imagery_classes()["low_stratus"], top_response=0.4, extinction_growth=0.1
    )
    back = classes_from({"low_stratus": class_table(one)}, "a table")["low_stratus"]
    assert back == one
    cloud = back.cloud(0)
    assert float(cloud.response.top) == pytest.approx(0.4)
    assert float(cloud.extinction_growth) == pytest.approx(0.1)
