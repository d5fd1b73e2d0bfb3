"""The days on which slow tests passed are noted, and only those."""

from typing import Any, cast

import pytest

from tests import slow_passes


@pytest.fixture
def days(tmp_path, monkeypatch):
    file = tmp_path / "slow_passes.txt"
    monkeypatch.setattr(slow_passes, "LIST", file)
    file.write_text("2020-01-01 tests/test_a.py\n2020-01-02 tests/test_b.py\n")
    return slow_passes.read


def report(nodeid, *, when="call", outcome="passed") -> pytest.TestReport:
    where = nodeid.split("::")[0], None, nodeid
    when, outcome = cast(Any, when), cast(Any, outcome)
    return pytest.TestReport(nodeid, where, {}, outcome, None, when)


def test_a_file_of_which_one_test_fails_has_no_day(days):
    keeper = slow_passes.Keeper()
    for each in (
        report("tests/test_a.py::test_one[x]"),
        report("tests/test_a.py::test_two", when="teardown", outcome="failed"),
        report("tests/test_c.py::test_one"),
        report("tests/test_d.py::test_one", when="setup"),
        report("tests/test_d.py::test_one", outcome="skipped"),
    ):
        keeper.pytest_runtest_logreport(each)
    keeper.pytest_sessionfinish()
    found = days()
    assert found.keys() == {"tests/test_b.py", "tests/test_c.py"}
    assert found["tests/test_b.py"] == "2020-01-02"
    assert found["tests/test_c.py"] > "2026"


def test_files_are_told_by_day(days):
    said = slow_passes.told({"tests/test_b.py", "tests/test_z.py"})
    assert "2020-01-01: tests/test_a.py" in said
    assert "2020-01-02: tests/test_b.py" in said
    assert said.endswith("not noted: tests/test_z.py")


def test_files_are_found_whose_marks_come_from_another():
    """The contract of sources marks its sources, and three files use them."""
    folder = "tests/unit/source_contract"
    parts = "batches", "independence", "parameters"
    assert slow_passes.marked(folder) == {f"{folder}/test_{p}.py" for p in parts}
