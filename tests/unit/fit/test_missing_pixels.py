"""Pixels without data say nothing: not to the target, the objective or the report."""

from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from tests.fit_results import made_up_result
from tests.generated import DIALECT, default_calibration, window, write_abi_l1b
from tests.scenes import NIGHT
from tests.small_fits import (
    BLOCKS,
    SHAPE,
    flecked,
    small_class,
    small_imagery,
    small_target,
)

from cloudjax_data import DataError, open_folder
from cloudjax_fit.fit_files import cloud_fractions, fit_numbers, fit_report
from cloudjax_fit.fit_inputs import read_inputs
from cloudjax_fit.fit_settings import FitSettings
from cloudjax_fit.functionals import Values
from cloudjax_fit.histogram import Bins
from cloudjax_fit.objective import pose, residuals
from cloudjax_fit.observation import BINS, observe, target_of
from cloudjax_fit.parameters import put_all
from cloudjax_fit.scene_parameters import scene_parameters
from cloudjax_fit.statistics import Coverage, Histograms, Statistics
from cloudjax_fit.uncertainty import _bootstrap
from cloudjax_scenes.simulated_image import SimulatedImage


NIGHT_SHAPE = (64, 64)
# Pixels count as cloud with soft weights.
SOFT = 0.01
WEST = np.s_[:, :32]


def night_kelvin(seed: int = 0) -> np.ndarray:
    """Cloud of 225 to 260 K over four fifths of the east, less in the west."""
    rng = np.random.default_rng(seed)
    share = np.where(np.arange(64) < 32, 0.3, 0.8)
    cloud = rng.random(NIGHT_SHAPE) < share
    return np.where(cloud, rng.uniform(225.0, 260.0, NIGHT_SHAPE), 288.0)


def night_scene(folder, kelvin, dqf=None):
    folder.mkdir(parents=True, exist_ok=True)
    radiance = default_calibration(13).radiance(np.nan_to_num(kelvin, nan=200.0))
    radiance = np.where(np.isnan(kelvin), np.nan, radiance)
    write_abi_l1b(
        folder,
        band=13,
        radiance=radiance,
        grid=window(NIGHT_SHAPE),
        start=NIGHT,
        dqf=dqf,
    )
    return folder


def missing(kind: str) -> np.ndarray:
    """Which pixels have no data, in the ways in which real scans lose them."""
    gone = np.zeros(NIGHT_SHAPE, bool)
    if kind == "west":
        gone[WEST] = True
    elif kind == "half way":
        gone[40:] = True
    elif kind == "stripes":
        gone[::5] = True
    elif kind == "most of a block":
        gone[:8, :8] = True
        gone[0, 0] = False
    return gone


KINDS = ("west", "half way", "stripes", "most of a block")


@pytest.mark.parametrize(
    ("kind", "how"),
    [*((kind, "fill") for kind in KINDS), *(("west", flag) for flag in (1, 2, 3, 4))],
)
def test_a_target_is_of_the_pixels_with_data(tmp_path, kind, how):
    """By numpy: share, blocks and mean of the pixels that are left."""
    kelvin, gone = night_kelvin(), missing(kind)
    if how == "fill":
        night_scene(tmp_path, np.where(gone, np.nan, kelvin))
    else:
        night_scene(tmp_path, kelvin, np.where(gone, how, 0))
    target = observe(open_folder(tmp_path).read())
    cloud = (kelvin < 270) & ~gone
    assert target.cloud_fraction == pytest.approx(cloud.sum() / (~gone).sum(), rel=SOFT)
    np.testing.assert_array_equal(target.good, ~gone)
    blocks = (8, 8, 8, 8)
    np.testing.assert_array_equal(
        target.block_valid.reshape(8, 8), (~gone).reshape(blocks).sum((1, 3))
    )
    np.testing.assert_allclose(
        target.block_share, (~gone).reshape(blocks).mean((1, 3)).reshape(-1)
    )
    seen = target.quantiles[13]
    fk1, fk2, bc1, bc2 = DIALECT[13].coefficients
    radiance = fk1 / (np.exp(fk2 / (bc1 + bc2 * kelvin[cloud])) - 1)
    assert seen.count == pytest.approx(cloud.sum(), rel=SOFT)
    assert seen.equal_weights().mean() == pytest.approx(radiance.mean(), rel=0.01)


@pytest.fixture(scope="module")
def halves():
    """The same target with and without data in the west, and its scene."""
    imagery, images = small_imagery(), flecked()
    whole = small_target(imagery, images)
    east = np.zeros(SHAPE, bool)
    east[:, SHAPE[1] // 2 :] = True
    half = target_of(imagery, images, east, BLOCKS)
    made_of = FitSettings(steps=3).scene_from(imagery, None, {"low": small_class()})
    parameters = scene_parameters(made_of)
    defaults = jnp.asarray([p.default for p in parameters])
    return whole, half, put_all(made_of.build(), parameters, defaults), parameters


RESIDUALS = eqx.filter_jit(residuals)


def _posed(target, halves, rays=10_000):
    _, _, scene, parameters = halves
    free = [p for p in parameters if p.name == "low.threshold"]
    return pose(target, scene, free, rays=rays, seed=0, texture=False)


def test_rays_are_drawn_from_pixels_with_data(halves):
    _, half, *_ = halves
    _, pixels = _posed(half, halves)
    np.testing.assert_array_equal(pixels, np.flatnonzero(half.good.reshape(-1)))


def test_blocks_without_data_have_no_say(halves):
    """The residuals of blocks: zero in the west, and in the east those of a fit to the
    whole image, of whose rays they are."""
    whole, half, *_ = halves
    found = {}
    for name, target in (("whole", whole), ("half", half)):
        problem, _ = _posed(target, halves)
        rest = np.asarray(RESIDUALS(jnp.zeros(1), problem))[2 * BINS :]
        found[name] = rest[1:17].reshape(4, 4)
    assert np.abs(found["whole"][:, :2]).min() > 0.1
    np.testing.assert_array_equal(found["half"][:, :2], 0.0)
    np.testing.assert_allclose(found["half"][:, 2:], found["whole"][:, 2:], atol=1e-4)


def test_blocks_with_little_data_have_little_say(halves):
    """A ninth of a block weighs √(2/9), all of it 1; a half is enough."""
    whole, *_ = halves
    good = np.ones(SHAPE, bool)
    good[:6, :6] = False
    good[:2, :2] = True
    good[:3, 6:12] = False
    scarce = target_of(whole.imagery, flecked(), good, BLOCKS)
    # As many rays as half of the image has, for which the residuals are compiled.
    problem, _ = _posed(scarce, halves, rays=SHAPE[0] * SHAPE[1] // 2)
    expected = np.ones(16)
    expected[0] = np.sqrt(2 / 9)
    np.testing.assert_allclose(problem.block_weight, expected, rtol=1e-6)
    alike = eqx.tree_at(lambda p: p.block_weight, problem, jnp.ones(16))
    found, plain = (
        np.asarray(RESIDUALS(jnp.zeros(1), p))[2 * BINS + 1 :][:16]
        for p in (problem, alike)
    )
    assert np.abs(plain).min() > 0.1
    np.testing.assert_allclose(found, expected * plain, rtol=1e-5)


def test_images_are_compared_where_there_are_data(halves):
    """Nonsense in the west changes neither distances nor shares."""
    _, half, *_ = halves
    images = flecked(1)
    radiance = np.stack([images[1], images[13]])
    (warm,) = default_calibration(13).radiance(np.array([288.0]))
    cloud = images[13] < warm
    image = SimulatedImage((1, 13), radiance, cloud.astype(float), 3.0 * cloud[None])
    spoilt = radiance.copy()
    spoilt[..., : SHAPE[1] // 2] = 999.0
    covered = np.where(half.good, cloud, 1.0)
    other = replace(image, radiance=spoilt, cloud=covered)
    assert half.distances(image) == half.distances(other)
    assert half.distances(image)[1].n_simulated == (cloud & half.good).sum()


def test_resampling_knows_no_blocks_without_data():
    """The covariance of counts of blocks is that of those with data alone."""
    rng = np.random.default_rng(0)

    def sums(pixels):
        counts = rng.integers(1, 9, (12, 1, 5)).astype(float)
        cover = np.stack([counts.sum((1, 2)), np.full(12, pixels)], axis=-1)
        return [counts, cover[:, None]]

    def of(counts, cover):
        bins = Bins(jnp.zeros(1), jnp.ones(1), 5)
        radiances = Histograms(
            functional=Values(),
            bins=bins,
            scale=jnp.ones(1),
            observed=jnp.asarray(counts),
        )
        cover = Coverage(jnp.asarray(cover))
        return Statistics(jnp.ones(1), (radiances,), cover, ())

    def padded(sums):
        return [np.pad(s, ((0, 20), (0, 0), (0, 0))) for s in sums]

    observed, simulated = sums(60.0), sums(7.0)
    alone = _bootstrap(of(*observed), simulated, np.random.default_rng(1))
    whole = of(*padded(observed))
    again = _bootstrap(whole, padded(simulated), np.random.default_rng(1))
    np.testing.assert_array_equal(alone, again)


def test_the_report_tells_what_is_missing(tmp_path):
    """Half of the image: shares are of the other half, by numpy."""
    kelvin, gone = night_kelvin(), missing("west")
    night_scene(tmp_path / "scene", np.where(gone, np.nan, kelvin))
    inputs = read_inputs(tmp_path / "scene")
    result = made_up_result(inputs)
    cloud = np.where(gone, 1.0, 0.25)
    radiance = np.where(np.isnan(result.image.radiance), 1.0, result.image.radiance)
    image = replace(result.image, cloud=cloud, radiance=radiance)
    result = replace(result, image=image)
    shares = cloud_fractions(result)
    expected = (kelvin[~gone] < 270).mean()
    assert shares["observed"] == pytest.approx(expected, rel=SOFT)
    assert shares["simulated"] == pytest.approx(0.25)
    assert fit_numbers(result)["scene"]["missing_share"] == pytest.approx(0.5)
    page = fit_report(result)
    assert page.scene["pixels"] == "64 × 64, 50.0% without data"
    weights = page.bands[0].simulated_fit.weights
    assert weights is not None
    assert weights.max() == 0.25


def test_a_band_without_data_is_named(tmp_path):
    night_scene(tmp_path, np.full(NIGHT_SHAPE, np.nan))
    with pytest.raises(DataError, match=r"Band 13 of .* has no good pixel that sees"):
        read_inputs(tmp_path, bands=(13,))


def test_bands_without_common_data_are_named(tmp_path):
    kelvin, gone = night_kelvin(), missing("west")
    night_scene(tmp_path, np.where(gone, np.nan, kelvin))
    east = default_calibration(15).radiance(kelvin)
    write_abi_l1b(
        tmp_path,
        band=15,
        radiance=np.where(gone, east, np.nan),
        grid=window(NIGHT_SHAPE),
        start=NIGHT,
    )
    with pytest.raises(DataError, match="good in all of the bands 13, 15: use fewer"):
        read_inputs(tmp_path)


def test_space_beside_the_earth_is_not_missing(tmp_path):
    """The western limb: what is flagged as good in space is no cloud of 3 K."""
    grid = window(NIGHT_SHAPE, 5.6e-4, west_edge_rad=-0.1568, north_edge_rad=0.0112)
    _, hit = grid.rays().ground()
    hit = hit.reshape(NIGHT_SHAPE)
    assert 0.3 < hit.mean() < 0.97
    kelvin = night_kelvin()
    seen = default_calibration(13).radiance(kelvin)
    radiance = np.where(hit, seen, 0.05)
    write_abi_l1b(
        tmp_path,
        band=13,
        radiance=radiance,
        grid=grid,
        start=NIGHT,
        dqf=np.zeros(NIGHT_SHAPE, int),
    )
    target = observe(open_folder(tmp_path).read())
    expected = (kelvin[hit] < 270).mean()
    assert target.cloud_fraction == pytest.approx(expected, rel=SOFT)
    assert target.quantiles[13].values[0] > 10.0


@pytest.mark.parametrize("alike", [13, 1])
def test_a_band_of_one_value_has_bins(alike):
    """Saturated, or two bands that contradict each other: what one sees, one does not.

    A fit ended as a fault of the program, for single precision had no bins so narrow.
    """
    images = flecked()
    images[alike] = np.full_like(images[alike], images[alike].mean())
    target = small_target(small_imagery(), images)
    for one in target.statistics.parts:
        assert np.isfinite(np.asarray(one.observed)).all()
        if isinstance(one, Histograms):
            assert (np.asarray(one.bins.width) > 0).all()
