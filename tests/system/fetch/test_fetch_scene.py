"""From a date to a folder that a fit takes as it is, over a real S3 server."""

import hashlib
import json
import re
import shlex
import shutil
from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import SimpleNamespace

import pytest
from click.testing import CliRunner

from cloudjax_cli import main
from cloudjax_data import open_folder, read_weather
from cloudjax_data.weather_fields import GROUND, REQUIRED
from tests.commands import run, sentence_of
from tests.mischief import busy, cut, of_files
from tests.noaa_buckets import LEVELS_HPA, add_gfs, add_scan, goes_folder


README = Path(__file__).parents[3] / "README.md"
# In ABI's mode 6 a CONUS scan begins 77 seconds after each fifth minute.
SCAN = datetime(2023, 4, 26, 17, 1, 17, 500000, tzinfo=UTC)
NOON = datetime(2023, 4, 26, 12, tzinfo=UTC)
CONUS = (
    *("--satellite", "goes16", "--time", "2023-04-26T17:00", "--sector", "conus"),
    *("--bands", "1,3,13"),
)


@pytest.fixture
def scene(root, store):
    """The buckets of the README's example."""
    add_scan(root, SCAN, products=("ACHA", "ACM", "COD"))
    add_scan(root, SCAN - timedelta(minutes=5))
    add_scan(root, SCAN + timedelta(minutes=5))
    add_gfs(root, NOON, 3)
    add_gfs(root, NOON + timedelta(hours=6))
    store.fill(root)


def test_a_scene_is_fetched_and_taken_as_it_is(scene, mischief, tmp_path):
    out = tmp_path / "scene"
    result = run("fetch", "scene", *CONUS, "-o", out, "--endpoint", mischief.url)
    assert result.exit_code == 0, result.output
    folder = open_folder(out)
    assert (folder.platform, folder.sector, folder.start) == ("G16", "C", SCAN)
    assert list(folder.bands) == [1, 3, 13]
    assert set(folder.products) == {"ACHA", "ACM", "COD"}
    times = [read_weather(file).valid_time for file in folder.weather]
    assert times == [NOON + timedelta(hours=3), NOON + timedelta(hours=6)]
    assert folder.read().start == SCAN
    assert folder.ignored == ()
    assert not (out / ".partial").exists()
    result = CliRunner().invoke(main, ["info", str(out)])
    assert "advection           6 hours of the winds in gfs.20230426" in result.output


def test_the_manifest_says_where_each_file_came_from(scene, mischief, tmp_path):
    out = tmp_path / "scene"
    run("fetch", "scene", *CONUS, "-o", out, "--endpoint", mischief.url)
    files = json.loads((out / "manifest.json").read_text())["files"]
    assert set(files) == {file.name for file in out.iterdir()} - {"manifest.json"}
    for name, entry in files.items():
        content = (out / name).read_bytes()
        assert entry["size"] == len(content)
        assert entry["sha256"] == hashlib.sha256(content).hexdigest()
        assert entry["origin"].startswith(f"{mischief.url}/noaa-")
        assert entry["origin"].endswith(entry["key"])
        age = datetime.now(UTC) - datetime.fromisoformat(entry["fetched"])
        assert timedelta(0) <= age < timedelta(minutes=5)


def test_only_the_needed_messages_of_the_gfs_are_asked_for(scene, mischief, tmp_path):
    result = run(
        "fetch", "gfs", "--time", "2023-04-26T17:00", "-o", tmp_path, *_at(mischief)
    )
    assert result.exit_code == 0, result.output
    bucket = "/noaa-gfs-bdp-pds/gfs.20230426"
    f003 = f"{bucket}/12/atmos/gfs.t12z.pgrb2.1p00.f003"
    asked = [r for r in mischief.transfers if r.path == f003]
    assert f"{f003}.idx" in [r.path for r in mischief.transfers]
    assert all(r.range is not None for r in asked)
    # 50 hPa comes first in the file, and is none of the reader's; SPFH ends a level.
    assert len(asked) == len(LEVELS_HPA) + 1
    size = sum(last + 1 - first for first, last in (r.range for r in asked if r.range))
    file = tmp_path / "gfs.20230426.t12z.pgrb2.1p00.f003.grib2"
    assert file.stat().st_size == size
    cube = read_weather(file)
    assert list(cube.data["level"]) == [1000, 850, 500, 200, 70]
    assert set(cube.data) == {*REQUIRED, "clwmr", *GROUND}


def test_a_terminal_gets_a_bar(scene, mischief, tmp_path, monkeypatch):
    terminal = SimpleNamespace(stdout=SimpleNamespace(isatty=lambda: True))
    monkeypatch.setattr("cloudjax_cli.fetch_progress.sys", terminal)
    result = run("fetch", "goes", *CONUS, "-o", tmp_path, *_at(mischief))
    assert result.exit_code == 0, result.output
    assert ".nc" not in result.output
    assert "0.1 MB transferred" in result.output


def test_a_dry_run_lists_names_and_sizes_and_writes_nothing(scene, mischief, tmp_path):
    out = tmp_path / "scene"
    result = run("fetch", "scene", *CONUS, "-o", out, "--dry-run", *_at(mischief))
    assert result.exit_code == 0, result.output
    for word in ("RadC-M6C13_G16_s20231161701", "ACHAC", "t18z.pgrb2.1p00.f000"):
        assert word in result.output
    assert "8 files, 0.1 MB: nothing fetched" in result.output
    assert not out.exists()
    assert all(r.path.endswith(".idx") for r in mischief.transfers)


def test_a_second_run_transfers_nothing(scene, mischief, tmp_path):
    command = ("scene", *CONUS, "-o", tmp_path / "scene", *_at(mischief))
    assert run("fetch", *command).exit_code == 0
    mischief.requests.clear()
    again = run("fetch", *command)
    assert again.exit_code == 0, again.output
    assert again.output.count("was there") == 8
    assert mischief.transfers == []
    assert mischief.requests


def test_a_file_that_was_changed_is_fetched_again(scene, mischief, tmp_path):
    command = ("scene", *CONUS, "-o", tmp_path / "scene", *_at(mischief))
    run("fetch", *command)
    (changed,) = (tmp_path / "scene").glob("*C13*")
    content = changed.read_bytes()
    changed.write_bytes(content[:-1] + b"x")
    mischief.requests.clear()
    assert run("fetch", *command).exit_code == 0
    assert changed.read_bytes() == content
    assert len(mischief.transfers) == 1


def test_files_without_a_manifest_are_looked_at_and_kept(scene, mischief, tmp_path):
    command = ("goes", *CONUS, "-o", tmp_path, *_at(mischief))
    run("fetch", *command)
    (tmp_path / "manifest.json").write_text("{ not JSON")
    mischief.requests.clear()
    assert run("fetch", *command).exit_code == 0
    assert mischief.transfers == []
    assert len(json.loads((tmp_path / "manifest.json").read_text())["files"]) == 6


def test_a_cache_is_shared(scene, mischief, tmp_path):
    cache = tmp_path / "cache"
    for name in ("one", "two"):
        out = tmp_path / name
        result = run(
            "fetch", "scene", *CONUS, "-o", out, "--cache", cache, *_at(mischief)
        )
        assert result.exit_code == 0, result.output
        assert list(open_folder(out).bands) == [1, 3, 13]
        assert len(json.loads((out / "manifest.json").read_text())["files"]) == 8
        assert not (out / ".partial").exists()
    # of the second, neither files nor indices
    paths = [r.path for r in mischief.transfers if r.path.endswith(".nc")]
    assert len(paths) == len(set(paths)) == 6
    (band,) = (tmp_path / "two").glob("*C13*")
    assert band.samefile(cache / band.name)


def test_a_folder_in_the_layout_of_the_buckets_is_an_endpoint(scene, root, tmp_path):
    for endpoint in (root, root.as_uri()):
        out = tmp_path / endpoint.__class__.__name__
        result = run("fetch", "scene", *CONUS, "-o", out, "--endpoint", endpoint)
        assert result.exit_code == 0, result.output
        assert list(open_folder(out).bands) == [1, 3, 13]


def test_listings_go_on_over_many_pages(root, store, mischief, tmp_path):
    for minute in range(8):
        for sector in ("M1", "M2"):
            start = datetime(2023, 4, 26, 17, minute, 25, tzinfo=UTC)
            add_scan(root, start, sector=sector, bands=(1, 13))
    store.fill(root)
    mischief.page = 5
    options = ("--satellite", "goes16", "--bands", "1,13", "--no-products")
    for sector in ("meso1", "meso2"):
        mischief.requests.clear()
        out = tmp_path / sector
        time = "2023-04-26T17:06:40Z"
        result = run(
            "fetch",
            *("goes", *options, "--sector", sector, "--time", time),
            *("-o", out, *_at(mischief)),
        )
        assert result.exit_code == 0, result.output
        folder = open_folder(out)
        assert folder.sector == f"M{sector[-1]}"
        assert folder.start == datetime(2023, 4, 26, 17, 6, 25, tzinfo=UTC) + (
            timedelta(milliseconds=100)
        )
        # of the hour before and of this one
        assert sum(r.is_list for r in mischief.requests) == 1 + 7


def test_all_bands_are_of_the_nearest_scan_that_has_them(
    root, store, mischief, tmp_path
):
    near = datetime(2022, 8, 1, 3, 0, 20, tzinfo=UTC)
    at = {"satellite": "goes17", "sector": "F"}
    add_scan(root, near - timedelta(minutes=10), bands=(7, 13), **at)
    add_scan(root, near, bands=(13,), **at)
    store.fill(root)
    common = ("--sector", "full", "--no-products", "--time", "2022-08-01T05:00+02:00")
    result = run(
        "fetch",
        *("goes", "--satellite", "west", *common, "--bands", "7,13"),
        *("-o", tmp_path / "both", *_at(mischief)),
    )
    assert result.exit_code == 0, result.output
    assert open_folder(tmp_path / "both").start == near - timedelta(minutes=10) + (
        timedelta(milliseconds=100)
    )
    result = run(
        "fetch",
        *("goes", "--satellite", "west", *common, "--bands", "13"),
        *("-o", tmp_path / "one", *_at(mischief)),
    )
    assert open_folder(tmp_path / "one").platform == "G17"
    (file,) = (tmp_path / "one").glob("*.nc")
    assert "_s20222130300" in file.name


def test_what_is_not_essential_is_noted_and_left_out(root, store, mischief, tmp_path):
    add_scan(root, SCAN, sector="M2", products=("ACHA",))
    add_gfs(root, NOON, 3)
    store.fill(root)
    result = run(
        "fetch",
        *("scene", "--satellite", "east", "--time", "2023-04-26T17:00"),
        *("--sector", "meso2", "--bands", "1,3,13", "-o", tmp_path / "scene"),
        *_at(mischief),
    )
    assert result.exit_code == 0, result.output
    notes = [line for line in result.output.splitlines() if line.startswith("mind: ")]
    assert len(notes) == 3
    for note, word in zip(notes, ("no ACM", "no COD", "no GFS for"), strict=True):
        assert word in note


def test_a_longer_forecast_stands_in_for_a_missing_analysis(
    root, store, mischief, tmp_path
):
    add_gfs(root, NOON, 3)
    add_gfs(root, NOON, 6)
    store.fill(root)
    result = run(
        "fetch", "gfs", "--time", "2023-04-26T17:00", "-o", tmp_path, *_at(mischief)
    )
    assert result.exit_code == 0, result.output
    times = {read_weather(f).valid_time for f in tmp_path.glob("*.grib2")}
    assert times == {NOON + timedelta(hours=3), NOON + timedelta(hours=6)}


def test_a_missing_hour_is_a_sentence(scene, mischief, tmp_path):
    out = tmp_path / "scene"
    late = ("--time", "2023-04-26T19:40", *CONUS[4:], "-o", out, *_at(mischief))
    sentence = sentence_of(run("fetch", "scene", *CONUS[:2], *late))
    assert (
        "no scan of sector conus with all of bands 1, 3, 13 within 15 min" in sentence
    )
    assert "nothing was written" in sentence
    sentence = sentence_of(
        run("fetch", "scene", *CONUS[:6], "--bands", "1,2", "-o", out, *_at(mischief))
    )
    assert "that of 17:01:17 has only 1" in sentence
    sentence = sentence_of(
        run("fetch", "gfs", "--time", "2019-10-27T20:00", "-o", out, *_at(mischief))
    )
    assert "no GFS of grid 1p00 around 2019-10-27 20:00 UTC" in sentence
    assert not out.exists()


def test_a_busy_store_and_a_cut_connection_are_overcome(scene, mischief, tmp_path):
    mischief.faults = [
        of_files(busy, times=2),
        of_files(cut(3000), times=3),
    ]
    result = run("fetch", "goes", *CONUS, "-o", tmp_path, *_at(mischief))
    assert result.exit_code == 0, result.output
    assert list(open_folder(tmp_path).bands) == [1, 3, 13]


def test_the_example_of_the_readme_runs_unchanged(
    scene, mischief, tmp_path, monkeypatch
):
    text = README.read_text(encoding="utf-8")
    (command,) = re.findall(r"^cloudjax (fetch scene .*[^\\])$", text, re.MULTILINE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("CLOUDJAX_ENDPOINT", mischief.url)
    result = CliRunner().invoke(main, shlex.split(command.split("  #")[0]))
    assert result.exit_code == 0, result.output
    output = shlex.split(command.split("  #")[0])[-1]
    assert list(open_folder(tmp_path / output).bands) == [1, 3, 13]


@pytest.mark.shared_data
def test_real_files_pass_their_checks(shared_data, root, store, mischief, tmp_path):
    start = datetime(2019, 10, 27, 20, 0, 27, tzinfo=UTC)
    folder = goes_folder(root, "goes17", "L1b-RadM", start)
    for band in (3, 13):
        (file,) = (shared_data / "goes17_m1_20191027T2000").glob(f"*C{band:02d}_*")
        shutil.copyfile(file, folder / file.name)
    store.fill(root)
    result = run(
        "fetch",
        *("goes", "--satellite", "west", "--time", "2019-10-27T20:00", "--sector"),
        *("meso1", "--bands", "3,13", "-o", tmp_path / "scene", *_at(mischief)),
    )
    assert result.exit_code == 0, result.output
    assert open_folder(tmp_path / "scene").read().platform == "G17"


def _at(mischief) -> tuple[str, str]:
    return "--endpoint", mischief.url
