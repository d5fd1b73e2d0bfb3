"""Nothing half-written ever looks whole."""

import os
import stat

import pytest

from cloudjax_data import DataError
from cloudjax_data.whole_files import staged, whole, write_text_whole


def test_a_failed_move_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch):
    target = tmp_path / "new" / "fit.json"
    write_text_whole(target, "old")

    def fail(*_):
        raise OSError("disk full")

    monkeypatch.setattr("cloudjax_data.whole_files.os.replace", fail)
    with pytest.raises(OSError, match="disk full"):
        write_text_whole(target, "τ")
    assert target.read_text() == "old"
    assert list(target.parent.iterdir()) == [target]


def test_a_failed_write_leaves_nothing(tmp_path):
    def interrupted() -> None:
        with whole(tmp_path / "a.nc") as aside:
            aside.write_bytes(b"half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert not list(tmp_path.iterdir())


def test_a_file_shows_up_under_its_name_only_once_it_is_whole(tmp_path):
    path = tmp_path / "a.txt"
    with whole(path, tmp_path / "aside") as aside:
        aside.write_text("half")
        assert aside == tmp_path / "aside"
        assert not path.exists()
        aside.write_text("whole")
    assert path.read_text() == "whole"
    assert list(tmp_path.iterdir()) == [path]


def test_a_second_name_of_the_same_file_leaves_no_trace(tmp_path):
    """Renaming one name of a file to another of its names does nothing at all."""
    path = tmp_path / "a.txt"
    path.write_text("same")
    with whole(path) as aside:
        os.link(path, aside)
    assert path.read_text() == "same"
    assert list(tmp_path.iterdir()) == [path]


def test_files_have_the_permissions_of_others(tmp_path):
    (tmp_path / "plain").touch()
    write_text_whole(tmp_path / "one", "")
    with staged(tmp_path) as folder:
        (folder / "two").touch()
    modes = {stat.S_IMODE(file.stat().st_mode) for file in tmp_path.iterdir()}
    assert len(modes) == 1


def test_a_disk_that_fails_ends_in_one_sentence(tmp_path):
    said = r"\(No space left on device\): free some space or choose"
    with pytest.raises(DataError, match=said), staged(tmp_path / "out"):
        raise OSError(28, "No space left on device")
    assert not list((tmp_path / "out").iterdir())
