"""Where tasks run: here, or on workers that may be lost."""

import os
import signal
import time
from pathlib import Path

import jax
import pytest
from distributed import LocalCluster, get_worker

from cloudjax_cli.runners import Cluster, Here, OnDask
from cloudjax_data import DataError
from tests.commands import run, sentence_of


def test_an_address_and_a_number_of_workers_are_told_apart():
    def read(text):
        return Cluster().convert(text, None, None)

    assert read("local") == OnDask()
    assert read("local:3") == OnDask(workers=3)
    assert read("tcp://host:8786") == OnDask("tcp://host:8786")


@pytest.mark.parametrize("text", ["local:", "local:0", "local:x"])
def test_no_number_of_workers_is_refused(text):
    said = sentence_of(run("fit", "a", "b", "-o", "c", "--dask", text))
    assert "local:4" in said


def test_what_to_install_is_told(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    said = sentence_of(run("fit", "a", "b", "-o", "c", "--dask", "local"))
    assert "pip install 'cloudjax[cluster]'" in said


def _slowly(file: Path) -> tuple[str, int, int]:
    """Leave a trace of the process, and take a while."""
    with file.open("a") as trace:
        trace.write(f"{os.getpid()}\n")
    time.sleep(1.0)
    return file.name, os.getpid(), len(os.sched_getaffinity(0))


def test_what_is_compiled_is_forgotten_where_it_is_much(monkeypatch):
    """Where the pieces of mapped memory are many, a function is traced again."""
    traced = []

    @jax.jit
    def work(x):
        traced.append(x)
        return x + 1

    def done() -> int:
        for _ in Here().run(work, [1.0, 2.0]):
            pass
        return len(traced)

    assert done() == 1
    monkeypatch.setattr("cloudjax_cli.held_memory.MANY_MAPS", 0)
    assert [done(), done()] == [2, 4]


def _worker_of(number: int) -> str:
    return get_worker().address


def test_a_scheduler_elsewhere_is_found_by_its_address():
    """A scheduler and its worker run in threads here, and answer at ports."""
    cluster = LocalCluster(
        n_workers=1,
        threads_per_worker=1,
        processes=False,
        protocol="tcp",
        host="127.0.0.1",
        dashboard_address=":0",
    )
    with cluster:
        address = cluster.scheduler_address
        assert address.startswith("tcp://127.0.0.1:")
        runner = Cluster().convert(address, None, None)
        (worker,) = cluster.workers.values()
        found = dict(runner.run(_worker_of, [1, 2, 3]))
        assert found == dict.fromkeys([1, 2, 3], worker.address)


def test_a_scheduler_that_does_not_answer_is_named(monkeypatch):
    monkeypatch.setattr("cloudjax_cli.runners._PATIENCE_S", 0.2)
    runner = Cluster().convert("tcp://127.0.0.1:1", None, None)
    with pytest.raises(DataError, match="no scheduler of Dask answers at tcp://127"):
        list(runner.run(_worker_of, [1]))


def _alone(file: Path) -> int:
    """Leave a trace, and take the worker along where there is a word to do so."""
    with file.open("a") as trace:
        trace.write("done\n")
    if file.name == "2" and len(file.read_text().split()) == 1:
        time.sleep(2.0)  # the first two are told of
        os.kill(os.getpid(), signal.SIGKILL)
    return int(file.name)


@pytest.mark.slow
def test_what_was_done_is_not_done_again_when_its_worker_dies(tmp_path):
    """A worker that dies in its third task has told of the first two."""
    tasks = [tmp_path / f"{i}" for i in range(4)]
    told = [result for _, result in OnDask(workers=1).run(_alone, tasks)]
    assert set(told) == {0, 1, 2, 3}
    assert [len(p.read_text().split()) for p in tasks] == [1, 1, 2, 1]


@pytest.mark.slow
def test_a_killed_worker_loses_nothing(tmp_path):
    """kill -9 in the middle of a task; and each worker has cores of its own."""
    tasks = [tmp_path / f"{i}" for i in range(8)]
    found, killed = [], 0
    for task, result in OnDask(workers=2).run(_slowly, tasks):
        assert isinstance(result, tuple)
        assert task.name == result[0]
        found.append(result)
        if not killed:
            begun = next(p for p in tasks if p.exists() and p != task)
            killed = int(begun.read_text().split()[0])
            os.kill(killed, signal.SIGKILL)
    assert sorted(name for name, *_ in found) == [p.name for p in tasks]
    assert any(len(p.read_text().split()) == 2 for p in tasks)
    cores = len(os.sched_getaffinity(0))
    assert {count for *_, count in found} <= {max(1, cores // 2), -(-cores // 2)}
