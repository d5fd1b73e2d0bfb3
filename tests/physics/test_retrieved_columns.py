"""What a satellite retrieves, put where it stands and seen again."""

import functools as ft

import jax
import numpy as np
import pytest

from cloudjax import Rays
from cloudjax.geometry.geodesy import dot, ecef, up
from cloudjax.geometry.shells import chords
from cloudjax_data import read_retrieval
from cloudjax_scenes.cloud_thickness import ICE, WATER
from cloudjax_scenes.model_columns import CloudColumns, depth_columns
from cloudjax_scenes.model_scene import ModelWorld
from cloudjax_scenes.retrieved_columns import RetrievedColumns
from cloudjax_scenes.undone_parallax import standing_places
from tests.generated_retrieval import write_retrieval
from tests.helpers import sampling


STEPS = 24
RNG = np.random.default_rng(1)
SIDE = 30
# An even sheet, clear about it; and one cloud in the middle of clear sky.
SHEET, BLOCK = np.full((2, SIDE, SIDE), np.nan)
SHEET[3:-3, 3:-3] = 6.0
BLOCK[12:18, 13:19] = 5.0
UNEVEN = np.where(np.isnan(SHEET), np.nan, RNG.uniform(0.3, 150, SHEET.shape))
HIGH, LOW = np.full((6, 6), 10e3), np.full((6, 6), 3e3)
# High in the west and low in the east.
MIXED = np.repeat([[10e3, 10e3, 10e3, 3e3, 3e3, 3e3]], 6, axis=0)


@pytest.fixture(scope="module")
def columns(tmp_path_factory):
    @ft.cache
    def made(name: str) -> RetrievedColumns:
        depth, top = {
            "sheet": (SHEET, HIGH),
            "uneven": (UNEVEN, HIGH),
            "low sheet": (SHEET, LOW),
            "block": (BLOCK, HIGH),
            "mixed": (UNEVEN, MIXED),
        }[name]
        folder = tmp_path_factory.mktemp("scan")
        return RetrievedColumns.of(read_retrieval(write_retrieval(folder, depth, top)))

    return made


@ft.partial(jax.jit, static_argnames="steps")
def _occupied(cloud, way, steps=STEPS):
    return cloud.occupancy(cloud.sample(way, (), steps=steps, slopes=False), steps)


def _seen_of(cloud, rays: Rays) -> np.ndarray:
    """Optical depth along rays, of water or of ice."""
    way = cloud.navigate(rays, chords(rays, cloud.shell), sampling())
    fraction = np.asarray(_occupied(cloud, way).fraction)[0]
    length = np.asarray(way.path.length_m)
    return fraction.sum(-1) * cloud.extinction_per_m * length / STEPS


def _seen(columns: RetrievedColumns, rays: Rays) -> np.ndarray:
    each = ModelWorld(columns).classes.values()
    return np.sum([_seen_of(cloud, rays) for cloud in each], axis=0)


def _from_above(columns: RetrievedColumns) -> Rays:
    latitude, longitude = (
        place.ravel() for place in columns.grid.places(*columns.grid.mesh())
    )
    down = -up(latitude, longitude)
    ground = ecef(latitude, longitude, np.zeros_like(latitude))
    return Rays(ground - 3e4 * down, down, 1e-5)


@pytest.mark.parametrize("name", ["uneven", "mixed"])
def test_straight_down_columns_have_the_optical_depth_of_the_product(columns, name):
    """Each column has the optical depth of one pixel, to 0.1 %, by a vertical march.

    Geometry: rays down the middles of the columns. Expected: numbers of the file
    wherever there is cloud; where all tops are equally high, so that nothing hides
    anything, as many of them as pixels. Where both stand in a column, each of water and
    ice is one pixel's.
    """
    made = columns(name)
    rays, product = _from_above(made), made.retrieval.optical_depth
    held = np.unique(product[made.retrieval.cloudy])
    total = np.zeros(len(rays))
    for cloud in ModelWorld(made).classes.values():
        found = _seen_of(cloud, rays)
        cloudy = found > 1e-3
        nearest = held[np.abs(found[cloudy, None] - held).argmin(1)]
        np.testing.assert_allclose(found[cloudy], nearest, rtol=1e-3)
        total += found
    expected = depth_columns(made).column_depth
    np.testing.assert_allclose(total.reshape(expected.shape), expected, rtol=1e-3)
    if name == "uneven":
        assert (total > 0).sum() == pytest.approx((product > 0).sum(), rel=0.03)
        assert total.sum() == pytest.approx(product.sum(), rel=0.03)


def _zeniths(columns: RetrievedColumns):
    """The satellite's rays and their cosines with the vertical at the ground."""
    grid = columns.retrieval.grid
    rays = grid.rays()
    ground, _ = rays.ground()
    return rays, -dot(rays.direction, up(ground.latitude_deg, ground.longitude_deg))


def test_the_satellite_sees_the_slanted_depth_of_an_even_sheet(columns):
    """Seen from the satellite the optical depth is τ/cos θ, inside of an even sheet.

    Geometry: tops at 10 km, 52° from nadir; pixels at 4 or more from the sheet's edges,
    more than the 4 km that lines of sight cross. Expected: Beer's law for a slab. The
    cosine at the ground is 0.2 % less than that in the cloud. Tolerance 1 %.
    """
    made = columns("sheet")
    rays, cosine = _zeniths(made)
    found = (_seen(made, rays) * cosine).reshape(SIDE, SIDE)
    np.testing.assert_allclose(found[8:-8, 8:-8], 6.0, rtol=0.01)


@pytest.mark.parametrize("name", ["sheet", "low sheet", "block"])
def test_seen_from_the_satellite_clouds_are_at_their_own_pixels(columns, name):
    """The centre of the optical depth seen is that of the product, to 0.1 pixels.

    Geometry: tops at 10 km or 3 km, 52° from nadir. Clouds of one height come to stand
    in the middles of columns, and lines of sight go through the middles of clouds.
    Without undoing the parallax they are 0.8 to 2.5 pixels off. The sum is that of the
    product to 1 %.
    """
    made = columns(name)
    rays, cosine = _zeniths(made)
    found = (_seen(made, rays) * cosine).reshape(SIDE, SIDE)
    product = made.retrieval.optical_depth
    for axis in (0, 1):
        index = np.indices(found.shape)[axis]
        centres = [(index * tau).sum() / tau.sum() for tau in (found, product)]
        assert centres[0] == pytest.approx(centres[1], abs=0.1)
    assert found.sum() == pytest.approx(product.sum(), rel=0.01)


def test_clouds_stand_nearer_to_the_satellite_than_what_is_behind_them(columns):
    """At 10 km, 52° from nadir: by 10 km tan 52° = 12.8 km, to 3 %."""
    grid = columns("sheet").retrieval.grid
    low, high = (
        ecef(*standing_places(grid, np.full(grid.shape, h)), np.zeros(grid.shape))
        for h in (0.0, 10e3)
    )
    _, cosine = _zeniths(columns("sheet"))
    expected = 10e3 * np.tan(np.arccos(cosine)).reshape(grid.shape)
    way = np.linalg.norm(high - low, axis=-1)
    np.testing.assert_allclose(way, expected, rtol=0.03)
    towards = dot(high - low, grid.satellite_m - low)
    assert (towards > 0).all()


def test_layers_stay_apart_and_above_the_ground(columns):
    made = columns("mixed")
    assert [part.phase for part in made.condensate] == ["water", "ice"]
    assert (np.diff(made.heights_m, axis=0) > 0).all()
    assert made.heights_m.min() >= 0
    assert made.out_of_sight >= 0
    assert isinstance(made, CloudColumns)


def test_thickness_grows_with_optical_depth_within_its_bounds():
    """The regressions' own numbers: 0.39 ln 20 - 0.01 = 1.158 km of water, and of ice
    at 10 km, 223.25 K, 7.2 - 5.358 + 0.95 ln 10 = 4.029 km.
    """
    one = ft.partial(np.full, 1)
    assert WATER.thickness_m(one(20.0), one(3e3))[0] == pytest.approx(1158, abs=1)
    assert ICE.thickness_m(one(10.0), one(10e3))[0] == pytest.approx(4029, abs=2)
    assert WATER.thickness_m(one(0.1), one(3e3))[0] == 100
    assert WATER.thickness_m(one(150.0), one(500.0))[0] == 500
