"""`cloudjax particles`: files of a run's clouds, and what is refused."""

import numpy as np
import pytest

from cloudjax_data import read_retrieval
from cloudjax_scenes.model_columns import depth_columns
from cloudjax_scenes.particle_reading import read_particles
from cloudjax_scenes.retrieved_columns import RetrievedColumns
from tests.commands import run, sentence_of
from tests.generated_retrieval import write_retrieval
from tests.generated_wrf import COLUMNS, LEVELS, ROWS, write_wrf


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wrf")
    times = ["2005-08-28_12:00:00", "2005-08-28_13:00:00"]
    write_wrf(folder / "run", times=times)
    write_wrf(folder / "clear", QCLOUD=np.zeros((LEVELS, ROWS, COLUMNS)))
    return folder


def _particles(folder, *options, name="run", output="p.nc"):
    given = "--place", "20,10", "-o", folder / output
    return run("particles", folder / name, *given, *options)


def test_frames_are_files_of_their_moments(folder):
    result = _particles(folder, "-n", 50, "--frames", 3, "--minutes", 30)
    assert result.exit_code == 0, result.output
    files = sorted(folder.glob("p-*.nc"))
    assert [file.name for file in files] == ["p-000.nc", "p-001.nc", "p-002.nc"]
    found = [read_particles(file) for file in files]
    assert [str(time)[11:16] for _, time in found] == ["12:00", "12:30", "13:00"]
    assert [len(particles) for particles, _ in found] == [50, 50, 50]
    # The wind blows to the east and upwards.
    first, middle = (found[i][0] for i in (0, 1))
    dying = np.isfinite(middle.death_s)
    assert middle[dying].longitude_deg.mean() > first.longitude_deg.mean()


def test_rejection_draws_other_columns_than_strides(folder):
    one = _particles(folder, "-n", 40, output="one.nc")
    other = _particles(folder, "-n", 40, "--sampler", "rejection", output="two.nc")
    assert (one.exit_code, other.exit_code) == (0, 0)
    (strides, _), (draws, _) = (
        read_particles(folder / name) for name in ("one.nc", "two.nc")
    )
    assert strides.extinction_area_m2.sum() == pytest.approx(
        draws.extinction_area_m2.sum(), rel=1e-5
    )
    assert not np.allclose(strides.latitude_deg, draws.latitude_deg)


def test_far_particles_are_fewer_and_stand_for_all(folder):
    """All are some 400 km from the viewer, twice as far as near: an eighth stays."""
    whole = _particles(folder, "-n", 800, output="whole.nc")
    view = "--viewer", "20,10,400", "--near-km", "200"
    thinned = _particles(folder, "-n", 800, *view, output="thin.nc")
    assert (whole.exit_code, thinned.exit_code) == (0, 0)
    (many, _), (few, _) = (
        read_particles(folder / name) for name in ("whole.nc", "thin.nc")
    )
    assert len(few) == pytest.approx(100, abs=2)
    assert few.extinction_area_m2.sum() == pytest.approx(
        many.extinction_area_m2.sum(), rel=1e-5
    )


REFUSED = {
    "none": (("-n", 0), "0 particles are none"),
    "K of nothing": (("--sampler", "rejection", "--k", 0), "K = 0 keeps no particle"),
    "K of strides": (("--k", 2), "leave out --k"),
    "no near": (("--viewer", "20,10,3"), "give --near-km"),
    "no viewer": (("--near-km", 3), "leave out --near-km"),
    "near of nothing": (("--viewer", "20,10,3", "--near-km", -1), "more than 0"),
    "no place": (("--viewer", "20,10"), "no place and height"),
    "too late": (("--frames", 4, "--minutes", 60), "choose other frames"),
    "not held": (("--time", "2006-01-01"), "choose other frames"),
}


@pytest.mark.parametrize(("options", "said"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_done_is_told(folder, options, said):
    before = set(folder.iterdir())
    assert said in sentence_of(_particles(folder, *options, output="new.nc"))
    assert set(folder.iterdir()) == before


def test_a_clear_time_and_an_unknown_ending_are_told(folder):
    assert "no cloud" in sentence_of(_particles(folder, name="clear"))
    assert "neither in .nc nor in .ply" in sentence_of(
        _particles(folder, output="p.vtk")
    )


def test_a_scan_becomes_particles_of_water_and_ice(tmp_path):
    """Tops of 10 km are ice, those of 3 km water; areas add up to the columns'."""
    tops = np.repeat([[10e3, 10e3, 3e3, 3e3]], 4, axis=0)
    write_retrieval(tmp_path / "scan", np.full((20, 20), 8.0), tops)
    made = run("particles", tmp_path / "scan", "-n", 300, "-o", tmp_path / "p.nc")
    assert made.exit_code == 0, made.output
    found, time = read_particles(tmp_path / "p.nc")
    columns = RetrievedColumns.of(read_retrieval(tmp_path / "scan"))
    assert str(time)[:19] == str(columns.time)[:19]
    whole = depth_columns(columns).extinction_area_m2()
    assert found.extinction_area_m2.sum() == pytest.approx(whole, rel=1e-5)
    frozen = found.ice_share == 1
    assert found[frozen].altitude_m.min() > 4e3 > found[~frozen].altitude_m.max()
    assert 0.3 < frozen.mean() < 0.7
    for given, said in (
        (("--frames", 2), "leave out --frames"),
        (("--time", "2020-01-01"), "leave out --time"),
        (("-n", 0), "0 particles are none"),
    ):
        refused = run("particles", tmp_path / "scan", *given, "-o", tmp_path / "q.nc")
        assert said in sentence_of(refused)
