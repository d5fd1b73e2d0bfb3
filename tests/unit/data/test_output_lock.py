"""Two processes never write one output, and a dead one keeps nobody out."""

import os
import subprocess
import sys

import pytest

from cloudjax_data import DataError
from cloudjax_data.output_lock import alone


HOLDS = """
import sys, time
from cloudjax_data.output_lock import alone
with alone(sys.argv[1], "fit"):
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def holder(tmp_path):
    command = [sys.executable, "-c", HOLDS, str(tmp_path / "out")]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"held\n"
        yield process
        process.kill()


def test_the_process_that_writes_is_named(holder, tmp_path):
    with pytest.raises(
        DataError, match=rf"out is being written by process {holder.pid}"
    ):
        alone(tmp_path / "out", "fit").__enter__()
    with alone(tmp_path / "out", "other"):
        pass


def test_a_killed_process_keeps_nobody_out(holder, tmp_path):
    holder.kill()
    holder.wait()
    with alone(tmp_path / "out", "fit"):
        assert str(os.getpid()) in (tmp_path / "out" / ".fit.lock").read_text()
    assert not list((tmp_path / "out").iterdir())


def test_nothing_stays_of_what_was_not_written(tmp_path):
    with alone(tmp_path / "a" / "b", "fit"):
        assert (tmp_path / "a" / "b").is_dir()
    assert not list(tmp_path.iterdir())
    with alone(tmp_path / "a" / "b", "fit"):
        (tmp_path / "a" / "b" / "file").touch()
    assert [p.name for p in (tmp_path / "a" / "b").iterdir()] == ["file"]
