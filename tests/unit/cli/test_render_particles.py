"""`cloudjax render SENSOR --particles`, and detail below columns."""

import numpy as np
import pytest

from cloudjax.clouds.detailed_columns import DetailedColumns
from cloudjax_scenes.particle_columns import ParticleColumns
from tests.commands import run, sentence_of
from tests.generated_wrf import write_wrf


SENSOR = "abi-meso-10km", "--centre", "20,-80", "--bands", "2,13"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("particles")
    write_wrf(folder / "wrfout")
    made = run(
        *("particles", folder / "wrfout", "--place", "20,-80", "-n", 200),
        *("-o", folder / "p.nc"),
    )
    assert made.exit_code == 0, made.output
    return folder


def _render(folder, *options):
    return run("render", *SENSOR, "-o", folder / "out.nc", *options)


def test_particles_reach_the_renderer_as_columns(folder, asked):
    result = _render(folder, "--particles", folder / "p.nc")
    assert result.exit_code == 0, (result.output, result.exception)
    assert "droplets have 10 um" in result.output
    ((world, bands, time),) = asked
    assert isinstance(world.columns, ParticleColumns)
    assert (time.hour, time.minute) == (12, 0)
    scene = world.scene(bands, time)
    assert [layer.name for layer in scene.layers] == ["water"]
    # All that there is of air is the standard atmosphere.
    assert scene.air is not None
    assert world.profiles is None


def test_detail_reaches_every_layer(folder, asked):
    wrf = "--wrf", folder / "wrfout", "--place", "20,-80"
    result = _render(folder, *wrf, "--detail", 700, "--seed", 3)
    assert result.exit_code == 0, (result.output, result.exception)
    ((world, bands, time),) = asked
    clouds = [layer.cloud for layer in world.scene(bands, time).layers]
    assert all(isinstance(cloud, DetailedColumns) for cloud in clouds)
    assert {(cloud.ladder.shortest_m, cloud.seed) for cloud in clouds} == {(700.0, 3)}
    np.testing.assert_allclose(clouds[0].ladder.longest_m, 3000.0)


REFUSED = {
    "too coarse": (("--wrf", "wrfout", "--detail", 4000), "none of the columns"),
    "of nothing": (("--wrf", "wrfout", "--detail", 0), "none of the columns"),
    "of weather": (("--weather", "x.grib2", "--detail", 500), "leave out --detail"),
    "seed of nothing": (("--wrf", "wrfout", "--seed", 3), "without --detail"),
    "frames": (("--particles", "p.nc", "--frames", 2), "leave out --frames"),
    "place": (("--particles", "p.nc", "--place", "1,2"), "leave out --place"),
    "two": (("--particles", "p.nc", "--weather", "x.grib2"), "give one"),
    "absent": (("--particles", "q.nc"), "q.nc is not a file"),
    "no particles": (("--particles", "wrfout"), "no latitude of particles"),
}


@pytest.mark.parametrize(("options", "said"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_done_is_told(folder, monkeypatch, options, said):
    monkeypatch.chdir(folder)
    ideal = ("--place", "20,-80") if "--wrf" in options else ()
    assert said in sentence_of(_render(folder, *options, *ideal))
    assert not (folder / "out.nc").exists()
