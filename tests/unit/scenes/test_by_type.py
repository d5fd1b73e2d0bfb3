"""Clouds by type: shapes, the table, files, and the particles that they become."""

from pathlib import Path

import numpy as np
import pytest

from cloudjax.geometry.map_projections import LocalPlane
from cloudjax.particles.deposit import deposited
from cloudjax_data import DataError
from cloudjax_scenes.by_type.cloud_types import built_in_types, cloud_type
from cloudjax_scenes.by_type.placing import particles_of
from cloudjax_scenes.by_type.shapes import SHAPES
from cloudjax_scenes.by_type.sky_file import read_sky
from cloudjax_scenes.particle_columns import columns_about
from tests.commands import run, sentence_of


EXAMPLE = Path(__file__).parents[3] / "docs/types_example.toml"
ORIGIN = (36.6, -121.9)
GROUP = '[[clouds]]\ntype = "cumulus"\nquantity = 2\nwithin_m = 3000\n'

# Share of the cell's volume, and where in the cell a shape is, by place off the axis
# (of 1/2) and height.
INSIDE = {
    "cube": (1.0, lambda x, y, z: np.ones_like(z, bool)),
    "cylinder": (np.pi / 4, lambda x, y, z: np.hypot(x, y) <= 0.5),
    "cone": (np.pi / 12, lambda x, y, z: np.hypot(x, y) <= (1 - z) / 2),
    "sphere": (np.pi / 6, lambda x, y, z: x**2 + y**2 + (z - 0.5) ** 2 <= 0.25),
    "dome": (np.pi / 6, lambda x, y, z: x**2 + y**2 + z**2 / 4 <= 0.25),
}


@pytest.mark.parametrize("name", SHAPES)
def test_shapes_are_filled_evenly(name):
    """Each eighth of the height has as many points as it has volume, and so has each
    ring about the axis: the volume is told by points of the whole cell that lie within.

    Tolerance: 5 standard deviations of both counts. Radii drawn evenly, or polar
    angles, are off by 20 and more.
    """
    rng = np.random.default_rng(0)
    count, (volume, inside) = 40_000, INSIDE[name]
    found = SHAPES[name].points(count, rng)
    assert inside(*(found * (1 - 1e-9)).T).all()
    cell = rng.uniform([-0.5, -0.5, 0], [0.5, 0.5, 1], (200_000, 3))
    even = cell[inside(*cell.T)]
    assert len(even) / len(cell) == pytest.approx(volume, abs=0.005)
    for part in (lambda p: p[:, 2], lambda p: np.hypot(p[:, 0], p[:, 1]) * 1.4):
        expected, edges = np.histogram(part(even), 8, (0, 1))
        got, _ = np.histogram(part(found), edges)
        scale = count / len(even)
        error = np.sqrt(np.maximum(expected, 1) * scale * (1 + scale))
        assert (np.abs(got - expected * scale) <= 5 * error).all()


def test_nine_types_and_more_come_with_cloudjax():
    types = {n: cloud_type(table, n) for n, table in built_in_types().items()}
    assert len(types) >= 9
    assert all(one.source for one in types.values())
    assert {one.shape for one in types.values()} == set(SHAPES)


def _sky(folder: Path, text: str):
    path = folder / "sky.toml"
    path.write_text(text)
    return read_sky(path)


@pytest.mark.parametrize("name", built_in_types())
def test_particles_have_the_optical_depth_of_their_type(tmp_path, name):
    """Their areas add up to it times the ground below; as columns they still have it,
    and stand between the base and the top of the largest cloud.
    """
    group = f'[[clouds]]\ntype = "{name}"\nquantity = 3\nwithin_m = 1\n'
    one = cloud_type(built_in_types()[name], name)
    sky = _sky(tmp_path, group + "vary = 0\n[origin]\nlatitude_deg=36\nlongitude_deg=5")
    found = particles_of(sky, (36.0, 5.0))
    ground = SHAPES[one.shape].footprint * one.stretch * one.width_m**2
    whole = 3 * one.optical_depth * ground
    assert found.extinction_area_m2.sum() == pytest.approx(whole)
    low, high = (
        found.altitude_m - found.radius_m,
        found.altitude_m + found.radius_m,
    )
    middle = (one.base_m + one.top_m) / 2
    assert low.min() >= min(one.base_m, middle - one.kernel_m) - 1
    assert high.max() <= max(one.top_m, middle + one.kernel_m) + 1
    held = deposited(found, columns_about(found))
    assert held.extinction_area_m2() == pytest.approx(whole, rel=1e-3)
    assert held.ice_share is not None
    frozen = (held.depth * held.ice_share).sum() / held.depth.sum()
    assert frozen == pytest.approx(one.ice_share)


def test_clouds_stand_in_their_square_and_lie_along_their_way(tmp_path):
    text = (
        '[[clouds]]\ntype = "cirrus"\nquantity = 1\nwithin_m = 1\nstretch = 10\n'
        "along_deg = 30\neast_m = 20000\nnorth_m = -5000\nsections = 200\n"
    )
    found = particles_of(_sky(tmp_path, text), ORIGIN)
    east, north = LocalPlane(*ORIGIN).project(found.latitude_deg, found.longitude_deg)
    np.testing.assert_allclose([east.mean(), north.mean()], [2e4, -5e3], atol=1.5e3)
    _, axes = np.linalg.eigh(np.cov(np.stack([east, north])))
    along = axes[:, -1] * np.sign(axes[1, -1])
    np.testing.assert_allclose(along, [0.5, np.sqrt(3) / 2], atol=0.03)


def test_levels_are_where_the_clouds_are(tmp_path):
    """Fog and cirrus: the air between is one level, and the fog has several."""
    text = GROUP.replace("cumulus", "fog") + GROUP.replace("cumulus", "cirrus")
    found = particles_of(_sky(tmp_path, text), ORIGIN)
    columns = columns_about(found)
    ends = columns.heights_m[:, 0, 0]
    assert len(ends) <= 33
    assert np.diff(ends).max() > 6e3
    assert (ends < 300).sum() > 4
    empty = np.argmax(np.diff(ends))
    depth = deposited(found, columns).depth
    assert depth[empty].sum() < 3e-3 * depth.sum()


def test_a_seed_is_a_sky_and_the_ground_lifts_it(tmp_path):
    first, again = (particles_of(_sky(tmp_path, GROUP), ORIGIN) for _ in range(2))
    np.testing.assert_array_equal(first.altitude_m, again.altitude_m)
    other = particles_of(_sky(tmp_path, "seed = 1\n" + GROUP), ORIGIN)
    assert np.abs(other.altitude_m - first.altitude_m).max() > 1
    high = "[origin]\nlatitude_deg = 36\nlongitude_deg = 5\nground_m = 700\n"
    lifted = particles_of(_sky(tmp_path, GROUP + high), ORIGIN)
    np.testing.assert_allclose(lifted.altitude_m - first.altitude_m, 700)


def test_the_example_is_a_sky():
    sky = read_sky(EXAMPLE)
    assert sky.origin_deg == ORIGIN
    assert [group.quantity for group in sky.groups] == [3, 12, 4]
    # A group's own numbers go before those of its type, and types may be one's own.
    assert sky.groups[1].type.width_m == 1400
    assert sky.groups[2].type.stretch == 5


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "has no clouds"),
        ("clouds = []", "add [[clouds]]"),
        ("clouds = [1]", "must be a table"),
        (GROUP.replace("cumulus", "cumulu"), "nearest known one is 'cumulus'"),
        (GROUP + "witdh_m = 3", "nearest known one is 'width_m'"),
        (GROUP.replace("quantity = 2", "quantity = 0"), "at least 1"),
        (GROUP + "base_m = 5000", "base_m = 5000 and top_m = 1800"),
        (GROUP + "base_m = nan", "a finite number"),
        (GROUP + "vary = 2", "from 0 to 1"),
        (GROUP + 'shape = "torus"', "cube or cylinder"),
        (GROUP + "[types.own]\nbase_m = 1", "type own has no top_m"),
        (GROUP + "[origin]\nlatitude_deg = 99\nlongitude_deg = 0", "is no place"),
        ("time = 3\n" + GROUP, "a time such as"),
        ("seed = -1\n" + GROUP, "at least 0"),
    ],
)
def test_files_that_are_no_sky_are_refused(tmp_path, text, said):
    with pytest.raises(DataError, match=r"sky\.toml") as caught:
        _sky(tmp_path, text)
    assert said in str(caught.value)


def test_too_many_kernels_are_refused(tmp_path):
    sky = _sky(tmp_path, GROUP.replace("quantity = 2", "quantity = 10000"))
    with pytest.raises(DataError, match="400000 kernels"):
        particles_of(sky, ORIGIN)


def test_the_command_line_says_what_a_file_lacks(tmp_path):
    path = tmp_path / "sky.toml"
    path.write_text(GROUP)
    given = "x3d", "--types", path, "-o", tmp_path / "out"
    assert "has no origin" in sentence_of(run(*given))
    assert "give --time" in sentence_of(run(*given, "--centre", "36,5"))
    assert "leave out --classes" in sentence_of(run(*given, "--classes", "x.toml"))
