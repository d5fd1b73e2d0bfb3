"""Locks, records and times: the small parts of a fetch."""

import threading
from datetime import UTC, datetime

import pytest

from cloudjax_data import DataError, Link
from cloudjax_data.fetch_gfs import bracket
from cloudjax_data.fetch_item import AbiItem
from cloudjax_data.file_lock import PARTIAL, locked
from cloudjax_data.manifest import checksums, read_manifest, record
from cloudjax_data.object_store import Retry, reason


def item(name: str, content: bytes = b"", etag: str | None = None) -> AbiItem:
    return AbiItem("noaa-goes16", f"folder/{name}", name, len(content), etag)


def test_a_lock_keeps_others_out_and_leaves_nothing(tmp_path):
    inside, order = threading.Event(), []

    def second():
        inside.wait()
        with locked(tmp_path, "a"):
            order.append("second")

    thread = threading.Thread(target=second)
    thread.start()
    with locked(tmp_path, "a"):
        inside.set()
        with locked(tmp_path, "b"):
            order.append("first")
        thread.join(0.2)
        assert thread.is_alive()
    thread.join(10)
    assert order == ["first", "second"]
    assert list(tmp_path.iterdir()) == []


def test_a_lock_file_of_a_dead_process_keeps_nobody_out(tmp_path):
    (tmp_path / PARTIAL).mkdir()
    (tmp_path / PARTIAL / "a.lock").touch()
    with locked(tmp_path, "a"):
        pass
    assert list(tmp_path.iterdir()) == []


def test_waiting_for_a_lock_can_be_given_up(tmp_path):
    with (
        locked(tmp_path, "a"),
        pytest.raises(InterruptedError),
        locked(tmp_path, "a", lambda: True),
    ):
        pass


def test_records_are_added_by_many_at_once(tmp_path):
    def add(number: int) -> None:
        file = tmp_path / f"{number}.nc"
        file.write_bytes(bytes(number))
        entry = item(file.name, bytes(number), f'"{number}"')
        record(tmp_path, entry, "https://example.org", checksums(file))

    threads = [threading.Thread(target=add, args=(n,)) for n in range(12)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    manifest = read_manifest(tmp_path)
    assert len(manifest.files) == 12
    for number in range(12):
        entry = item(f"{number}.nc", bytes(number), f'"{number}"')
        assert manifest.holds(tmp_path, entry)
        assert not manifest.holds(tmp_path, item(entry.name, bytes(number), '"x"'))
    (tmp_path / "3.nc").write_bytes(b"abc")
    assert not manifest.holds(tmp_path, item("3.nc", bytes(3), '"3"'))


@pytest.mark.parametrize("content", ["", "[]", '{"files": 3}', '{"files": {"a": 1}}'])
def test_a_manifest_that_is_none_is_as_if_there_were_none(tmp_path, content):
    (tmp_path / "manifest.json").write_text(content)
    assert read_manifest(tmp_path).files == {}


@pytest.mark.parametrize("name", ["../a.nc", "/a.nc", "a/b.nc", ".a.nc", "", ".."])
def test_only_plain_names_are_fetched(name):
    with pytest.raises(DataError, match="not a plain file name"):
        item(name)


@pytest.mark.parametrize(
    ("etag", "md5"),
    [
        ('"781e5e245d69b566979b86e28d23f2c7"', "781e5e245d69b566979b86e28d23f2c7"),
        ("781e5e245d69b566979b86e28d23f2c7", "781e5e245d69b566979b86e28d23f2c7"),
        ('"781e5e245d69b566979b86e28d23f2c7-3"', None),
        (None, None),
    ],
)
def test_tags_of_parts_are_no_checksums(etag, md5):
    assert item("a.nc", b"x", etag).md5 == md5


@pytest.mark.parametrize(
    ("time", "hours"),
    [((17, 0), (15, 18)), ((18, 0), (18,)), ((18, 1), (18, 21)), ((2, 59), (0, 3))],
)
def test_the_fields_around_a_time(time, hours):
    found = bracket(datetime(2023, 4, 26, *time, tzinfo=UTC))
    assert [valid.hour for valid in found] == list(hours)
    assert all(valid.day == 26 for valid in found)


def test_waits_grow_and_end():
    waited = []

    class Stop(threading.Event):
        def wait(self, timeout=None):
            waited.append(timeout)
            return False

    retry = Retry(Link(retries=4, first_wait_s=1.0), Stop())
    assert [retry.wait() for _ in range(5)] == [True] * 4 + [False]
    for seconds, longest in zip(waited, (1, 2, 4, 8), strict=True):
        assert 0.5 * longest <= seconds <= longest
    retry.progressed()
    assert retry.wait()


def test_reasons_are_short():
    error = OSError(
        "Generic S3 error: Error performing GET http://127.0.0.1/a in 5ms - Server "
        "returned non-2xx status code: 503 Service Unavailable: <?xml?>\n<Error>..."
    )
    assert reason(error) == (
        "Server returned non-2xx status code: 503 Service Unavailable"
    )
    assert reason(ValueError()) == "ValueError"
    assert len(reason(ValueError("x" * 999))) == 200
