"""The maps of weather models, against PROJ."""

import numpy as np
import pytest

from cloudjax.geometry.column_grid import ColumnGrid
from cloudjax.geometry.fixed_grid import FixedGrid
from cloudjax.geometry.geodesy import ecef
from cloudjax.geometry.geostationary_map import GeostationaryMap, column_grid
from cloudjax.geometry.map_projections import (
    MODEL_RADIUS_M,
    ConformalConic,
    LatLonMap,
    LocalPlane,
    Mercator,
)


pyproj = pytest.importorskip("pyproj")

R = MODEL_RADIUS_M
# A map, PROJ's own words for it, and a place in its middle.
MAPS = {
    "lambert": (
        ConformalConic.lambert(30.0, 60.0, -97.0),
        f"+proj=lcc +lat_1=30 +lat_2=60 +lat_0=0 +lon_0=-97 +R={R}",
        (40.0, -90.0),
    ),
    "touching": (
        ConformalConic.lambert(-35.0, -35.0, 20.0),
        f"+proj=lcc +lat_1=-35 +lat_2=-35 +lat_0=0 +lon_0=20 +R={R}",
        (-30.0, 25.0),
    ),
    "north pole": (
        ConformalConic.polar_stereographic(60.0, -45.0),
        f"+proj=stere +lat_0=90 +lat_ts=60 +lon_0=-45 +R={R}",
        (85.0, 100.0),
    ),
    "south pole": (
        ConformalConic.polar_stereographic(-71.0, 0.0),
        f"+proj=stere +lat_0=-90 +lat_ts=-71 +lon_0=0 +R={R}",
        (-80.0, -30.0),
    ),
    "mercator": (
        Mercator(179.0, 20.0),
        f"+proj=merc +lat_ts=20 +lon_0=179 +R={R}",
        (15.0, 180.0),
    ),
    "latlon": (LatLonMap(10.0), f"+proj=eqc +lon_0=10 +R={R}", (50.0, 12.0)),
    "turned": (
        LatLonMap(180.0, 40.0, 190.0),
        f"+proj=ob_tran +o_proj=eqc +o_lat_p=40 +o_lon_p=0 +lon_0=10 +R={R}",
        (48.0, 11.0),
    ),
    "plane": (
        LocalPlane(30.0, 60.0),
        f"+proj=aeqd +lat_0=30 +lon_0=60 +R={R}",
        (31.0, 61.0),
    ),
}
EACH_MAP = pytest.mark.parametrize(("own", "words", "middle"), MAPS.values(), ids=MAPS)


def _places(middle):
    rng = np.random.default_rng(0)
    return middle[0] + rng.uniform(-4, 4, 30), middle[1] + rng.uniform(-9, 9, 30)


@EACH_MAP
def test_coordinates_are_those_of_proj_but_for_an_offset(own, words, middle):
    latitude, longitude = _places(middle)
    x, y = own.project(latitude, longitude)
    x0, y0 = pyproj.Proj(words)(longitude, latitude)
    for mine, theirs in ((x, x0), (y, y0)):
        np.testing.assert_allclose(mine - mine[0], theirs - theirs[0], atol=1e-3)


@EACH_MAP
def test_places_are_the_inverse(own, words, middle):
    latitude, longitude = _places(middle)
    φ, λ = own.places(*own.project(latitude, longitude))
    np.testing.assert_allclose(φ, latitude, atol=1e-9)
    np.testing.assert_allclose((λ - longitude + 180) % 360 - 180, 0, atol=1e-9)


@EACH_MAP
def test_headings_are_the_directions_of_the_map_on_the_globe(own, words, middle):
    """By small steps to the north and along the map's y axis."""
    latitude, longitude = _places(middle)
    x, y = own.project(latitude, longitude)
    φ, λ = own.places(x, y + 10.0)
    north = np.radians(φ - latitude)
    east = np.radians((λ - longitude + 180) % 360 - 180) * np.cos(np.radians(latitude))
    turned = np.arctan2(east, north) - own.heading_rad(latitude, longitude)
    np.testing.assert_allclose(np.sin(turned), 0, atol=1e-3)
    assert np.cos(turned).min() > 0.99


@EACH_MAP
def test_a_grid_knows_its_rows_steps_and_areas(own, words, middle):
    x, y = own.project(*(np.array([degrees]) for degrees in middle))
    grid = ColumnGrid(own, (float(x[0]), float(y[0])), (2000.0, 3000.0), (4, 5))
    row, column = grid.mesh()
    places = grid.places(row, column)
    np.testing.assert_allclose(np.stack(grid.index(*places)), [row, column], atol=1e-6)
    # A way of a row and half a column, as the grid's derivative has it.
    moved = ecef(*grid.places(row + 0.01, column + 0.005), np.zeros(grid.shape))
    change = moved - ecef(*places, np.zeros(grid.shape))
    found = np.einsum("yxkc,yxc->yxk", grid.per_m(), change)
    np.testing.assert_allclose(
        found, np.broadcast_to([0.01, 0.005], found.shape), rtol=1e-3
    )
    factors = pyproj.Proj(words).get_factors(places[1], places[0])
    scale = factors.meridional_scale * factors.parallel_scale
    # An ellipsoid has not the areas of the sphere.
    np.testing.assert_allclose(grid.area_m2() * scale, 6e6, rtol=0.01)


@pytest.mark.parametrize("sweep", ["x", "y"])
def test_the_map_of_a_geostationary_imager_is_proj_s(sweep):
    words = "+proj=geos +h=35786023 +lon_0=-75 +a=6378137 +b=6356752.31414"
    theirs = pyproj.Proj(f"{words} +sweep={sweep}")
    own = GeostationaryMap(-75.0, sweep=sweep)
    latitude, longitude = np.meshgrid(
        np.linspace(-60, 60, 7), np.linspace(-130, -20, 6)
    )
    x, y = own.project(latitude, longitude)
    np.testing.assert_allclose((x, y), theirs(longitude, latitude), atol=1e-3)
    back = own.places(x, y)
    np.testing.assert_allclose(back, (latitude, longitude), atol=1e-9)
    east, north = own.to_east_and_north(latitude, longitude, *_northward(own))
    np.testing.assert_allclose(east, 0, atol=1e-3)
    assert (north > 0).all()


def _northward(own):
    """The map's own way of a step to the north, at the places of the test above."""
    latitude, longitude = np.meshgrid(
        np.linspace(-60, 60, 7), np.linspace(-130, -20, 6)
    )
    before, after = (own.project(latitude + d, longitude) for d in (-1e-3, 1e-3))
    way = np.subtract(after, before)
    return way / np.linalg.norm(way, axis=0)


def test_what_an_imager_does_not_see_is_not_on_its_map():
    own = GeostationaryMap(-75.0)
    x, _ = own.project(np.array([0.0]), np.array([105.0]))
    assert np.isinf(x)
    # Beyond the edge of the Earth there are places still, those of the edge.
    latitude, _ = own.places(np.array([0.0]), np.array([6e6]))
    assert 80 < latitude < 90


def test_columns_on_the_pixels_of_an_imager_are_where_these_see_the_ground():
    imager = FixedGrid(
        -0.07 + 5.6e-5 * np.arange(5), 0.09 - 5.6e-5 * np.arange(4), -75.0
    )
    grid = column_grid(imager, margin=2)
    ground, _ = imager.rays().ground()
    row, column = grid.index(ground.latitude_deg, ground.longitude_deg)
    expected = np.indices((4, 5)).reshape(2, -1) + 2
    np.testing.assert_allclose((row, column), expected, atol=1e-6)
    assert grid.shape == (8, 9)
