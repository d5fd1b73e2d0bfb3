"""What is stored, for all tests of this folder."""

import pytest

from .stored import Stored


KEY = pytest.StashKey[Stored]()


def pytest_configure(config: pytest.Config) -> None:
    config.stash[KEY] = Stored(bool(config.getoption("--regression-update")))


@pytest.fixture
def stored(request: pytest.FixtureRequest) -> Stored:
    return request.config.stash[KEY]


def pytest_terminal_summary(terminalreporter, config: pytest.Config) -> None:
    if config.stash[KEY].news:
        terminalreporter.section("what moved")
        for line in config.stash[KEY].news:
            terminalreporter.write_line(line)
