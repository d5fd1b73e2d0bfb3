"""Tests that take long, by a list of what they took: `make test` leaves them out.

`make test-all` and what must pass before a change lands run them. A line of the list is
a test function, or a file whose fixtures take long, which would be another test's time
if one were left out.
"""

from collections import defaultdict
from pathlib import Path

import pytest


LIST = Path(__file__).with_name("long_tests.txt")
# Of all parameters of a function together, compiling on two cores that are busy.
LONG_S = 4.0


def mark(items: list[pytest.Item]) -> None:
    """Mark the tests of the list as long."""
    known = set(LIST.read_text(encoding="utf-8").split())
    for item in items:
        if not known.isdisjoint(_names(item.nodeid)):
            item.add_marker("long")


def _names(nodeid: str) -> tuple[str, str]:
    """The file and the function of a test."""
    return nodeid.split("::")[0], nodeid.split("[")[0]


class Finder:
    """Writes the list anew for the files that are run."""

    def __init__(self):
        self._seconds: dict[str, float] = defaultdict(float)
        self._files: set[str] = set()
        self._slow_fixtures: set[str] = set()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Add up what the phases of tests take."""
        file, function = _names(report.nodeid)
        self._files.add(file)
        self._seconds[function] += report.duration
        if report.when == "setup" and report.duration > LONG_S:
            self._slow_fixtures.add(file)

    def pytest_sessionfinish(self) -> None:
        """Replace the lines of these files."""
        others = {
            name
            for name in LIST.read_text(encoding="utf-8").split()
            if _names(name)[0] not in self._files
        }
        found = {
            name
            for name, seconds in self._seconds.items()
            if seconds > LONG_S and _names(name)[0] not in self._slow_fixtures
        }
        lines = sorted(others | found | self._slow_fixtures)
        LIST.write_text("\n".join(lines) + "\n", encoding="utf-8")
