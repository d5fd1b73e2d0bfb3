"""When the slow tests last passed, file by file.

What must pass before a change lands leaves them out, for they take hours, and says this
instead: `python tests/slow_passes.py`.
"""

import subprocess
import sys
from collections import defaultdict
from collections.abc import Collection
from datetime import UTC, datetime
from pathlib import Path

import pytest


ROOT = Path(__file__).parents[1]
LIST = Path(__file__).with_suffix(".txt")


class Keeper:
    """Notes the day for each file of which all slow tests that ran have passed."""

    def __init__(self):
        self._passed: set[str] = set()
        self._failed: set[str] = set()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Sort files by how their tests end."""
        file = report.nodeid.split("::")[0]
        if report.failed:
            self._failed.add(file)
        elif report.passed and report.when == "call":
            self._passed.add(file)

    def pytest_sessionfinish(self) -> None:
        """Replace the days of these files; one that failed has none."""
        today = f"{datetime.now(UTC):%F}"
        days = read() | dict.fromkeys(self._passed - self._failed, today)
        lines = [f"{days[f]} {f}\n" for f in sorted(days) if f not in self._failed]
        LIST.write_text("".join(lines), encoding="utf-8")


def read() -> dict[str, str]:
    """Days by file."""
    if not LIST.is_file():
        return {}
    lines = LIST.read_text(encoding="utf-8").splitlines()
    return {file: day for day, file in (line.split(" ", 1) for line in lines)}


def marked(folder: str = "tests") -> set[str]:
    """Files of a folder that have slow tests, as pytest finds them."""
    collect = ("-m", "pytest", "--collect-only", "-q", "-m", "slow", folder)
    found = subprocess.run(
        [sys.executable, *collect], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return {line.split("::")[0] for line in found.stdout.splitlines() if "::" in line}


def told(files_with_slow_tests: Collection[str]) -> str:
    """The days of all files with slow tests, in words."""
    days = read()
    files: dict[str, list[str]] = defaultdict(list)
    for name in sorted(days.keys() | files_with_slow_tests):
        files[days.get(name, "not noted")].append(name)
    said = [f"  {day}: {', '.join(some)}" for day, some in sorted(files.items())]
    head = "Slow tests were left out ('make test-slow'). They last passed on"
    return "\n".join([head, *said])


if __name__ == "__main__":
    sys.stdout.write(told(marked()) + "\n")
