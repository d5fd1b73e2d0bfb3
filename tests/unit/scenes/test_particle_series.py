"""Particles between the times of a model, and as clouds of the renderer again."""

import dataclasses
from datetime import UTC, datetime, timedelta

import netCDF4
import numpy as np
import pytest

from cloudjax.particles.placement import place
from cloudjax_data import DataError, open_wrf, read_wrf
from cloudjax_scenes.model_columns import depth_columns
from cloudjax_scenes.particle_columns import ParticleColumns
from cloudjax_scenes.particle_files import write_particles
from cloudjax_scenes.particle_reading import read_particles
from cloudjax_scenes.particle_series import ParticleSeries
from tests.generated_wrf import COLUMNS, LEVELS, ROWS, write_wrf


CENTRE = (20.0, 10.0)
NOON = datetime(2005, 8, 28, 12, tzinfo=UTC)
TIMES = ["2005-08-28_12:00:00", "2005-08-28_13:00:00"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wrf")
    ice = np.zeros((LEVELS, ROWS, COLUMNS))
    ice[3] = 2e-3
    write_wrf(folder / "run", times=TIMES, QICE=ice)
    write_wrf(folder / "still", times=TIMES, without=["W"])
    return folder


def _series(file, count=3000) -> ParticleSeries:
    return ParticleSeries(open_wrf(file), count, centre=CENTRE)


def test_at_the_times_of_the_model_particles_stand_where_its_cloud_is(folder):
    series = _series(folder / "run")
    for number, time in enumerate(series.run.times):
        columns = depth_columns(read_wrf(series.run.frames[number], CENTRE))
        expected = place(columns, 3000, seed=number)
        found = series.at(time)
        np.testing.assert_array_equal(found.altitude_m, expected.altitude_m)
        np.testing.assert_array_equal(found.latitude_deg, expected.latitude_deg)


def test_between_two_times_both_have_their_share_and_drift(folder):
    """10 m/s along x and 1 m/s upwards: in a quarter of an hour 9 km and 900 m."""
    series = _series(folder / "run")
    found = series.at(NOON + timedelta(minutes=15))
    first, last = (series.at(time) for time in series.run.times)
    assert len(found) == pytest.approx(3000, abs=2)
    dying = np.isfinite(found.death_s)
    assert dying.sum() == pytest.approx(2250, abs=1)
    np.testing.assert_allclose(
        found.extinction_area_m2.sum(),
        0.75 * first.extinction_area_m2.sum() + 0.25 * last.extinction_area_m2.sum(),
        rtol=1e-3,
    )
    per_deg = np.radians(1) * 6.37e6 * np.cos(np.radians(20))

    def east_m(particles):
        return particles.longitude_deg.mean() * per_deg

    assert east_m(found[dying]) - east_m(first) == pytest.approx(9e3, rel=0.05)
    # The others are still three quarters of an hour upwind.
    assert east_m(found[~dying]) - east_m(last) == pytest.approx(-27e3, rel=0.05)
    rise = found[dying].altitude_m.mean() - first.altitude_m.mean()
    assert rise == pytest.approx(900, rel=0.05)
    assert found.death_s.min() > 0 > found[~dying].birth_s.max()
    assert found[dying].death_s.max() == pytest.approx(2700, rel=0.01)


def test_what_a_run_does_not_hold_is_told(folder):
    with pytest.raises(DataError, match="12:00 to 2005-08-28 13:00 UTC, which"):
        list(_series(folder / "run").frames(NOON, 3, 60.0))
    with pytest.raises(DataError, match="not all of U, V and W"):
        _series(folder / "still").at(NOON + timedelta(minutes=5))
    with pytest.raises(DataError, match="0 particles are none"):
        _series(folder / "run", 0)


@pytest.fixture(scope="module")
def written(folder):
    series = _series(folder / "run")
    particles = series.at(NOON)
    write_particles(folder / "p.nc", particles, NOON)
    write_particles(folder / "timeless.nc", particles)
    return particles


def test_what_was_written_is_read(folder, written):
    found, time = read_particles(folder / "p.nc")
    assert time == NOON
    for field in dataclasses.fields(found):
        one, other = (getattr(p, field.name) for p in (found, written))
        np.testing.assert_allclose(one, other, rtol=1e-6, atol=1e-5)
    assert 0.1 < found.ice_share.mean() < 0.9


def test_particles_are_clouds_with_all_that_they_have(folder, written):
    """Optical depth times area, of water and of ice, to 1e-6 of the particles'."""
    columns = ParticleColumns.read(folder / "p.nc")
    assert (columns.time, columns.sources) == (NOON, ("p.nc",))
    held = depth_columns(columns)
    frozen = held.depth * held.ice_share
    area = columns.grid.area_m2()
    whole = written.extinction_area_m2
    np.testing.assert_allclose(held.extinction_area_m2(), whole.sum(), rtol=2e-6)
    expected = (whole * written.ice_share).sum()
    np.testing.assert_allclose((frozen.sum(0) * area).sum(), expected, rtol=2e-6)
    assert [part.phase for part in columns.condensate] == ["water", "ice"]


def _changed(folder, change):
    path = folder / "changed.nc"
    path.write_bytes((folder / "p.nc").read_bytes())
    with netCDF4.Dataset(path, "a") as file:
        change(file)
    return path


WRONG = {
    "negative size": (lambda file: file["radius"].__setitem__(3, -1.0), "without a"),
    "no number": (lambda file: file["altitude"].__setitem__(3, np.nan), "no number"),
    "no variable": (lambda file: file.renameVariable("birth", "b"), "no birth"),
    "all dead": (lambda file: file["death"].__setitem__(slice(None), -1), "lives"),
    "no cloud": (
        lambda file: file["extinction_area"].__setitem__(slice(None), 0),
        "without any cloud",
    ),
}


@pytest.mark.usefixtures("written")
@pytest.mark.parametrize(("change", "said"), WRONG.values(), ids=WRONG)
def test_a_file_of_no_particles_is_told(folder, change, said):
    with pytest.raises(DataError, match=said):
        ParticleColumns.read(_changed(folder, change))


@pytest.mark.usefixtures("written")
def test_a_file_without_a_time_needs_one(folder):
    with pytest.raises(DataError, match="give --time"):
        ParticleColumns.read(folder / "timeless.nc")
    assert ParticleColumns.read(folder / "timeless.nc", NOON).time == NOON
