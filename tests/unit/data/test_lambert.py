"""The Lambert conformal conic map."""

import numpy as np
import pytest

from cloudjax_data import LambertConic


pyproj = pytest.importorskip("pyproj")

MAPS = [(265.0, 25.0, 25.0), (265.0, 25.0, 60.0), (10.0, 35.0, 65.0), (25.0, -30, -60)]


@pytest.mark.parametrize(("longitude", "one", "two"), MAPS)
def test_positions_agree_with_proj_up_to_scale_and_origin(longitude, one, two):
    projection = LambertConic(longitude, float(one), float(two))
    oracle = pyproj.Proj(
        proj="lcc", R=1.0, lon_0=longitude, lat_1=one, lat_2=two, lat_0=one
    )
    rng = np.random.default_rng(0)
    latitude = np.sign(one) * rng.uniform(10.0, 80.0, 50)
    east = longitude + rng.uniform(-60.0, 60.0, 50)
    x, y = projection.project(latitude, east)
    x0, y0 = oracle(east, latitude)
    scale = np.ptp(x0) / np.ptp(x)
    np.testing.assert_allclose(scale * x, x0, atol=1e-9)
    np.testing.assert_allclose(np.diff(scale * y), np.diff(y0), atol=1e-9)


@pytest.mark.parametrize(("longitude", "one", "two"), MAPS)
def test_rotation_agrees_with_proj(longitude, one, two):
    projection = LambertConic(longitude, float(one), float(two))
    oracle = pyproj.Proj(proj="lcc", R=1.0, lon_0=longitude, lat_1=one, lat_2=two)
    east = longitude + np.linspace(-50.0, 50.0, 11)
    factors = oracle.get_factors(east, np.full(11, float(one)))
    np.testing.assert_allclose(
        np.degrees(projection.rotation_rad(east)),
        factors.meridian_convergence,
        atol=1e-6,
    )
