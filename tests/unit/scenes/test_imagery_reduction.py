"""Where clouds of imagery are placed, and which class they are told into."""

from dataclasses import replace

import numpy as np
import pytest

from cloudjax import imagery_classes
from cloudjax.geometry.geodesy import up
from cloudjax_data import open_folder
from cloudjax_scenes.cloud_rule import CloudRule
from cloudjax_scenes.imagery_reduction import reduce_scene
from tests.generated import default_calibration, window, write_abi_l1b


SEA_K, RADIUS_KM = 289.0, 6371.0
STANDARD_K_KM = 6.5
SHAPE = (100, 100)
# 60 degrees aslant, so that 8.25 km of height look like 14 km of way.
GRID = window(SHAPE, north_edge_rad=0.1344)
BLOCK = np.s_[40:60, 40:60]
# Cloud up to where low clouds are warmer than what the usual rule takes for cloud.
WARM = CloudRule(None, np.inf, 13, 275.0)


def _reduced(folder, kelvin, classes=None, rule=WARM):
    folder.mkdir()
    radiance = default_calibration(13).radiance(kelvin)
    write_abi_l1b(folder, band=13, radiance=radiance, grid=GRID)
    scene = open_folder(folder).read((13,))
    return reduce_scene(scene, rule=rule, classes=classes).imagery


def _standard_k(altitude_m: float) -> float:
    return 288.15 - STANDARD_K_KM * altitude_m / 1000


@pytest.mark.parametrize(
    ("name", "cloud_m", "kelvin"),
    [("thick_cold", 4500.0, 235.0), ("low_stratus", 1000.0, 273.5)],
)
def test_clouds_are_placed_where_they_are_and_not_where_they_are_seen(
    tmp_path, name, cloud_m, kelvin
):
    """A line of sight at z degrees from the vertical meets the ground h tan(z) behind
    the cloud: away from the satellite, of which the cloud's own place is nearer.

    Tolerance: 1 km, for the cells are 6 km wide.
    """
    image = np.full(SHAPE, SEA_K)
    image[BLOCK] = kelvin
    imagery = _reduced(tmp_path / "scene", image)
    assert list(imagery.fractions) == [name]
    φ, λ = _middle_of(imagery, name)
    seen, _ = GRID.rays(_block_pixels()).ground()
    seen_φ, seen_λ = seen.latitude_deg.mean(), seen.longitude_deg.mean()
    vertical = up(np.array([seen_φ]), np.array([seen_λ]))[0]
    towards = -GRID.rays(_block_pixels()).direction.mean(0)
    zenith = np.arccos(vertical @ towards)
    assert np.degrees(zenith) == pytest.approx(60, abs=3)
    way_km = cloud_m / 1000 * np.tan(zenith)
    north, east = _north_east(towards, seen_φ, seen_λ)
    moved_km = RADIUS_KM * np.radians(
        [φ - seen_φ, (λ - seen_λ) * np.cos(np.radians(seen_φ))]
    )
    expected = way_km * np.array([north, east]) / np.hypot(north, east)
    assert way_km > 1.5
    np.testing.assert_allclose(moved_km, expected, atol=1.0)


def _block_pixels():
    return np.arange(SHAPE[0] * SHAPE[1]).reshape(SHAPE)[BLOCK].reshape(-1)


def _middle_of(imagery, name):
    fraction = imagery.fractions[name]
    # The sky around has none; cells that hardly have any are smoothing, or outside.
    fraction = np.where(fraction > 0.05, fraction, 0)
    φ, λ = np.meshgrid(imagery.latitude_deg, imagery.longitude_deg, indexing="ij")
    weight = fraction * np.cos(np.radians(φ))
    return (weight * φ).sum() / weight.sum(), (weight * λ).sum() / weight.sum()


def _north_east(direction, latitude_deg, longitude_deg):
    φ, λ = np.radians([latitude_deg, longitude_deg])
    north = np.array([-np.sin(φ) * np.cos(λ), -np.sin(φ) * np.sin(λ), np.cos(φ)])
    east = np.array([-np.sin(λ), np.cos(λ), 0.0])
    return direction @ north, direction @ east


def test_clouds_colder_than_the_air_at_2500_m_are_high(tmp_path):
    """300 m, 2 K, to either side of where the low shell ends."""
    image = np.full(SHAPE, SEA_K)
    image[BLOCK] = _standard_k(2800.0)
    assert list(_reduced(tmp_path / "high", image).fractions) == ["thick_cold"]
    image[BLOCK] = _standard_k(2200.0)
    assert list(_reduced(tmp_path / "low", image).fractions) == ["low_stratus"]


def test_the_threshold_is_that_of_the_class(tmp_path):
    classes = imagery_classes()
    high, low = classes["thick_cold"], classes["low_stratus"]
    assert high.imagery is not None
    assert low.imagery is not None
    moved = {
        "thick_cold": replace(
            high, imagery=replace(high.imagery, colder_than_standard_at_m=6000.0)
        ),
        "low_stratus": replace(
            low, imagery=replace(low.imagery, warmer_than_standard_at_m=6000.0)
        ),
    }
    image = np.full(SHAPE, SEA_K)
    image[BLOCK] = _standard_k(5500.0)
    found = _reduced(tmp_path / "scene", image, moved).fractions
    assert list(found) == ["low_stratus"]


def test_low_cloud_covers_a_share_of_what_high_cloud_leaves_free(tmp_path):
    """Columns in turn: high, low, clear, clear. A third of the sky that is seen below
    the high cloud is low cloud."""
    turn = np.arange(SHAPE[1]) % 4
    row = np.where(turn == 0, 235.0, np.where(turn == 1, 274.0, SEA_K))
    imagery = _reduced(tmp_path / "scene", np.tile(row, (SHAPE[0], 1)))
    middle = tuple(n // 2 for n in imagery.fractions["thick_cold"].shape)
    assert imagery.fractions["thick_cold"][middle] == pytest.approx(1 / 4, abs=0.02)
    assert imagery.fractions["low_stratus"][middle] == pytest.approx(1 / 3, abs=0.02)


def test_the_ground_is_that_of_the_clear_pixels(tmp_path):
    """Clear pixels of 279 and 289 K in halves, as they are, and under cloud between
    them what is next to it."""
    image = np.full(SHAPE, 289.0)
    image[:, 1::2] = 235.0
    image[:, :50:2] = 279.0
    imagery = _reduced(tmp_path / "scene", image)
    assert imagery.background.grid == imagery.grid
    west, east = (
        default_calibration(13).radiance(np.array([k]))[0] for k in (279.0, 289.0)
    )
    found = imagery.background.radiance[13]
    np.testing.assert_allclose(found[:, :50:2], west, rtol=1e-3)
    np.testing.assert_allclose(found[:, 50::2], east, rtol=1e-3)
    np.testing.assert_allclose(found[:, 1:48:2], west, rtol=1e-3)
    np.testing.assert_allclose(found[:, 53::2], east, rtol=1e-3)
