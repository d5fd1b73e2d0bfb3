"""What goes wrong on the way, and what it leaves on disk."""

import errno
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from cloudjax_data import (
    DataError,
    GoesRequest,
    Link,
    fetch,
    open_folder,
    plan_gfs,
    plan_goes,
)
from cloudjax_data import download as transfer
from tests.commands import run, sentence_of
from tests.generated import window, write_abi_l1b
from tests.mischief import (
    Request,
    busy,
    corrupted,
    cut,
    listed,
    of_files,
    shortened,
    slow,
)
from tests.noaa_buckets import add_gfs, add_scan, goes_folder


SCAN = datetime(2023, 4, 26, 17, 1, 17, 500000, tzinfo=UTC)
NOON = datetime(2023, 4, 26, 12, tzinfo=UTC)
BANDS = (1, 3, 13)
REQUEST = GoesRequest("goes16", SCAN, "conus", BANDS, products=False)
LARGE = GoesRequest("goes16", SCAN, "conus", (3,), products=False)


@pytest.fixture
def scan(root, store):
    files = add_scan(root, SCAN, bands=BANDS)
    store.fill(root)
    return files


@pytest.fixture
def large(root, store) -> bytes:
    """A band of several blocks, so that its parts are worth keeping; its content."""
    shape = (600, 600)
    file = write_abi_l1b(
        goes_folder(root, "goes16", "L1b-RadC", SCAN),
        band=3,
        radiance=np.random.default_rng(0).uniform(0.0, 300.0, shape),
        grid=window(shape, 2.8e-5),
        start=SCAN,
        platform="G16",
        sector="C",
    )
    store.fill(root)
    content = file.read_bytes()
    assert len(content) > 3 * 2**17
    return content


def fetched(request: GoesRequest, folder: Path, link: Link):
    return fetch(plan_goes(request, link).items, folder, link)


def failure(request: GoesRequest, folder: Path, link: Link) -> str:
    with pytest.raises(DataError) as caught:
        fetched(request, folder, link)
    sentence = str(caught.value)
    assert sentence.endswith(".")
    assert "\n" not in sentence
    return sentence


def test_a_cut_transfer_goes_on_where_it_stopped(large, mischief, link, tmp_path):
    mischief.faults = [of_files(cut(200_000), times=1)]
    done = fetched(LARGE, tmp_path, link)
    assert done.paths[0].read_bytes() == large
    first, second = (request.range for request in mischief.transfers)
    assert first == (0, len(large) - 1)
    assert second is not None
    # all but the block that was under way
    assert 200_000 - 2**17 < second[0] <= 200_000
    assert done.transferred == len(large)


def test_a_later_run_goes_on_too(large, mischief, link, tmp_path):
    impatient = Link(endpoint=mischief.url, retries=0)
    mischief.faults = [of_files(cut(200_000))]
    sentence = failure(LARGE, tmp_path, impatient)
    assert "holds 0 of 1 files, whole" in sentence
    assert ".partial the begun parts of 1, from which the same command" in sentence
    assert {file.name for file in tmp_path.iterdir()} == {".partial", "buckets"}
    mischief.faults = []
    mischief.requests.clear()
    done = fetched(LARGE, tmp_path, link)
    assert done.paths[0].read_bytes() == large
    assert 0 < done.transferred < len(large)
    assert [request.range for request in mischief.transfers] == [
        (len(large) - done.transferred, len(large) - 1)
    ]
    assert not (tmp_path / ".partial").exists()


def test_a_part_of_another_version_is_not_continued(large, mischief, tmp_path):
    link = Link(endpoint=mischief.url, retries=0)
    mischief.faults = [of_files(cut(200_000))]
    failure(LARGE, tmp_path, link)
    (part,) = (tmp_path / ".partial").iterdir()
    part.rename(part.with_name(f"{part.name[:-12]}000000000000"))
    mischief.faults = []
    done = fetched(LARGE, tmp_path, link)
    assert done.transferred == len(large)
    assert not (tmp_path / ".partial").exists()


def test_an_object_that_changes_after_it_was_listed(scan, mischief, link, tmp_path):
    items = plan_goes(REQUEST, link).items
    mischief.faults = [
        listed(lambda page: re.sub(r"[0-9a-f]{32}", "0" * 32, page)),
    ]
    sentence = failure(REQUEST, tmp_path, link)
    assert "it is another one than was listed" in sentence
    assert "holds 0 of 3 files" in sentence
    assert fetch(items, tmp_path, link).transferred == sum(item.size for item in items)


def test_answers_shorter_than_asked_for_are_pieced_together(
    scan, mischief, link, tmp_path
):
    mischief.faults = [of_files(shortened)]
    done = fetched(REQUEST, tmp_path, link)
    assert [p.stat().st_size for p in done.paths] == [f.stat().st_size for f in scan]
    assert len(mischief.transfers) > 3


def test_ranges_that_come_short_are_asked_for_again(
    root, store, mischief, link, tmp_path
):
    file = add_gfs(root, NOON)
    store.fill(root)
    items = plan_gfs(NOON, "1p00", link).items
    mischief.faults = [of_files(shortened, times=2)]
    (path,) = fetch(items, tmp_path, link).paths
    content = file.read_bytes()
    assert path.read_bytes() == b"".join(content[a:b] for a, b in items[0].ranges)


@pytest.mark.parametrize("change", [-7, 7])
def test_a_wrong_length_in_the_listing(scan, mischief, link, tmp_path, change):
    mischief.faults = [
        listed(
            lambda page: re.sub(
                r"<Size>(\d+)", lambda m: f"<Size>{int(m[1]) + change}", page
            )
        )
    ]
    sentence = failure(REQUEST, tmp_path, link)
    assert "holds 0 of 3 files" in sentence
    assert list(tmp_path.glob("*.nc")) == []


def test_corrupted_content_is_fetched_once_more(scan, mischief, link, tmp_path):
    mischief.faults = [of_files(corrupted, times=1)]
    fetched(REQUEST, tmp_path, link)
    assert open_folder(tmp_path).read().platform == "G16"
    assert len(mischief.transfers) == 2 * len(scan)


def test_content_that_stays_corrupted_is_refused(scan, mischief, link, tmp_path):
    mischief.faults = [of_files(corrupted)]
    sentence = failure(REQUEST, tmp_path, link)
    assert "came spoilt twice (its checksum is not that of the store)" in sentence
    assert list(tmp_path.glob("*.nc")) == []


def test_a_file_that_is_another_than_its_name_says(root, store, link, tmp_path):
    one, other = add_scan(root, SCAN, bands=(3, 13))
    one.write_bytes(other.read_bytes())
    store.fill(root)
    sentence = failure(LARGE, tmp_path, link)
    assert "it says of itself to be another file" in sentence


def test_a_file_without_a_checksum_is_read_through(root, link, tmp_path):
    # A folder as endpoint gives tags that are no checksums.
    (file,) = add_scan(root, SCAN, bands=(3,))
    content = bytearray(file.read_bytes())
    place = content.index(b"\x78\x01")  # where zlib starts
    content[place + 40 : place + 80] = bytes(40)
    file.write_bytes(content)
    local = Link(endpoint=str(root), retries=0)
    assert "came spoilt twice" in failure(LARGE, tmp_path / "out", local)


def test_broken_messages_of_the_gfs_are_refused(root, store, mischief, link, tmp_path):
    add_gfs(root, NOON)
    store.fill(root)
    mischief.faults = [of_files(corrupted)]
    items = plan_gfs(NOON, "1p00", link).items
    with pytest.raises(DataError, match=r"its message at byte \d+ is broken"):
        fetch(items, tmp_path, link)
    assert list(tmp_path.glob("*.grib2")) == []


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (lambda text: "<html>", "none of an index"),
        (lambda text: text.replace("d=2023", "d=2022"), "not all of the cycle"),
        (lambda text: re.sub(r":(\d+):", r":9\1:", text), "does not fit"),
        (lambda text: text.replace("VVEL", "DZDT"), "has no w on pressure levels"),
        (lambda text: text.replace(":anl:", ":6 hour fcst:"), "has no u, v"),
        (lambda text: "", "does not fit"),
        (lambda text: text * 2000, "bytes where at most"),
    ],
)
def test_an_index_that_is_none(root, store, link, tmp_path, edit, words):
    index = Path(f"{add_gfs(root, NOON)}.idx")
    index.write_text(edit(index.read_text()))
    store.fill(root)
    with pytest.raises(DataError, match=words):
        plan_gfs(NOON, "1p00", link)


def test_an_index_of_another_file(root, store, link, tmp_path):
    """The offsets fit, and the names do not."""
    index = Path(f"{add_gfs(root, NOON)}.idx")
    text = re.sub(r"TMP(:\d+ mb)", r"XXX\1", index.read_text()).replace("SPFH", "TMP")
    index.write_text(text)
    store.fill(root)
    with pytest.raises(DataError, match="it lacks 5 of 39 fields"):
        fetch(plan_gfs(NOON, "1p00", link).items, tmp_path, link)


def test_a_server_that_stays_silent(scan, mischief, tmp_path):
    # Long enough for a busy machine to answer what is not slow.
    silence = slow(30.0)
    mischief.faults = [of_files(silence)]
    link = Link(endpoint=mischief.url, timeout_s=1.0, retries=1, first_wait_s=0.01)
    before = time.monotonic()
    sentence = failure(REQUEST, tmp_path, link)
    assert time.monotonic() - before < 20
    assert "could not be had" in sentence
    mischief.faults = [of_files(silence, times=1)]
    assert len(fetched(REQUEST, tmp_path, link).paths) == 3


def test_a_store_that_is_always_busy_or_not_there(scan, mischief, tmp_path):
    mischief.faults = [lambda request, answer: busy(request, answer)]
    command = ("goes", "--satellite", "goes16", "--sector", "conus", "--time")
    command = (*command, SCAN.isoformat(), "-o", tmp_path / "out", "--retries", "0")
    sentence = sentence_of(run("fetch", *command, "--endpoint", mischief.url))
    assert "503" in sentence
    assert "nothing was written" in sentence
    sentence = sentence_of(run("fetch", *command, "--endpoint", "http://127.0.0.1:9"))
    assert "error sending request" in sentence
    sentence = sentence_of(run("fetch", *command, "--endpoint", tmp_path / "no"))
    assert "is not a folder" in sentence
    assert not (tmp_path / "out").exists()


def test_a_bucket_that_is_not_there_is_not_asked_again(mischief):
    patient = Link(endpoint=mischief.url, retries=9, first_wait_s=5.0)
    with pytest.raises(DataError, match="404 Not Found"):
        plan_goes(REQUEST, patient)
    assert len(mischief.requests) == 1


def test_a_full_disk_says_so(scan, mischief, link, tmp_path, monkeypatch):
    real, room = os.write, [50_000]

    def write(descriptor, data):
        if room[0] <= 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        written = real(descriptor, data[: room[0]])
        room[0] -= written
        return written

    monkeypatch.setattr(transfer.os, "write", write)
    sentence = failure(REQUEST, tmp_path, link)
    assert sentence.startswith(f"The disk of {tmp_path} is full: free some space")
    assert "of 3 files, whole" in sentence
    assert "the begun parts of" in sentence
    monkeypatch.undo()
    assert len(fetched(REQUEST, tmp_path, link).paths) == 3


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_that_cannot_be_written(scan, link, tmp_path):
    closed = tmp_path / "closed"
    closed.mkdir(mode=0o500)
    assert "cannot be written" in failure(REQUEST, closed / "out", link)


def test_a_file_in_place_of_the_folder(scan, link, tmp_path):
    (tmp_path / "out").write_text("")
    assert f"{tmp_path / 'out'} cannot be written" in failure(
        REQUEST, tmp_path / "out", link
    )


HOUR = "ABI-L1b-RadC/2023/116/17"
GOOD = "OR_ABI-L1b-RadC-M6C03_G16_s20231161701175_e20231161703175_c20231161703214.nc"


def add_to_listings(mischief, key: str) -> None:
    """A key that is not in the store appears first in what it lists."""
    entry = f"<Contents><Key>{key}</Key><LastModified>2023-04-26T17:10:00.000Z"
    entry += "</LastModified><ETag>&quot;x&quot;</ETag><Size>9</Size></Contents>"
    mischief.faults = [
        listed(lambda page: page.replace("<Contents>", f"{entry}<Contents>", 1))
    ]


@pytest.mark.parametrize(
    "key",
    [f"/etc/{GOOD}", f"{HOUR}\\..\\{GOOD}", f"{HOUR}/.{GOOD}", f"{HOUR}/{GOOD}.sh"],
)
def test_keys_that_are_not_noaas_are_left_alone(scan, mischief, link, tmp_path, key):
    add_to_listings(mischief, key)
    found = link.bucket("noaa-goes16").list(HOUR)
    assert found[0].key == key.lstrip("/")
    fetched(REQUEST, tmp_path / "out", link)
    names = {p.name for p in (tmp_path / "out").iterdir()}
    assert names == {*(file.name for file in scan), "manifest.json"}
    assert len(mischief.transfers) == len(scan)


@pytest.mark.parametrize(
    "key",
    [f"{HOUR}/../../../evil/{GOOD}", f"../../{GOOD}", f"{HOUR}/{GOOD}/../../x.nc"],
)
def test_keys_that_lead_elsewhere_are_refused(scan, mischief, link, tmp_path, key):
    """The client itself takes no listing that holds one."""
    add_to_listings(mischief, key)
    sentence = failure(REQUEST, tmp_path / "out", link)
    assert "would not list" in sentence
    assert "invalid path" in sentence
    assert not (tmp_path / "out").exists()
    assert mischief.transfers == []


def _command(mischief, out: Path) -> list[str]:
    code = "import sys; from cloudjax_cli import main; main(sys.argv[1:])"
    options = ["--satellite", "goes16", "--time", SCAN.isoformat()]
    options += ["--sector", "conus", "--no-products", "-o", str(out)]
    options += ["--endpoint", mischief.url]
    return [sys.executable, "-c", code, "fetch", "goes", *options]


def test_two_processes_share_a_folder(scan, mischief, tmp_path):
    mischief.faults = [of_files(slow(0.5))]
    command = [*_command(mischief, tmp_path), "--bands", "1,3,13"]
    both = [
        subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(2)
    ]
    outputs = [process.communicate(timeout=60)[0] for process in both]
    assert [process.returncode for process in both] == [0, 0], outputs
    # Each file came once, whoever brought it.
    paths = [request.path for request in mischief.transfers]
    assert len(paths) == len(set(paths)) == 3
    assert sum(output.count("was there") for output in outputs) == 3
    assert len(json.loads((tmp_path / "manifest.json").read_text())["files"]) == 3
    assert not (tmp_path / ".partial").exists()


@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGINT])
def test_a_process_that_is_ended_in_the_middle(large, mischief, link, tmp_path, end):
    released = threading.Event()
    mischief.faults = [of_files(cut(300_000, hold=released), times=1)]
    command = [*_command(mischief, tmp_path), "--bands", "3"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    try:
        _until(lambda: any(p.stat().st_size for p in tmp_path.glob(".partial/*.nc.*")))
        process.send_signal(end)
        released.set()
        errors = process.communicate(timeout=30)[1]
    finally:
        released.set()
        process.kill()
    if end == signal.SIGINT:
        assert process.returncode == 130
        assert errors.startswith("Interrupted: what is in")
    assert list(tmp_path.glob("*.nc")) == []
    assert not (tmp_path / "manifest.json").exists()
    with pytest.raises(DataError, match="no ABI file"):
        open_folder(tmp_path)
    mischief.requests.clear()
    done = fetched(LARGE, tmp_path, link)
    assert done.paths[0].read_bytes() == large
    (again,) = (request.range for request in mischief.transfers)
    assert again is not None
    assert again[0] >= 2**17
    assert not (tmp_path / ".partial").exists()


def _until(true, seconds: float = 30.0) -> None:
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_requests_are_told_apart():
    """The record that other tests count on."""
    assert Request("GET", "/noaa-goes16?list-type=2&prefix=a", None).is_list
    assert Request("GET", "/noaa-goes16/a.nc", (0, 1)).is_transfer
    assert not Request("HEAD", "/noaa-goes16/a.nc", None).is_transfer
