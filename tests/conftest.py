"""One regime for all tests: where the real files are, and JAX without surprises."""

import os
from importlib.metadata import version
from pathlib import Path

import pytest


ROOT = Path(__file__).parents[1]
# Nearly all time of the suite is that of compiling, and these halve it. The variable is
# empty in `make test-slow`, which compiles as users do. No xla_cpu_parallel_codegen_-
# split_count=1 beside them: a tenth less time, and reverse derivatives of exactly 0.
QUICK = {
    "xla_backend_optimization_level": "0",
    "xla_llvm_disable_expensive_passes": "true",
}
# XLA ends a process that gives it a flag it does not know, and it forgot this one.
if tuple(map(int, version("jaxlib").split(".")[:2])) < (0, 11):
    QUICK["xla_cpu_use_fusion_emitters"] = "false"
# Functions compiled by one test serve the others, in other processes and in later runs.
# In the environment, for JAX reads it at its import, also in the processes that tests
# start; a size makes JAX lock the folder, which several workers share.
KEPT = ROOT / ".pytest_cache" / f"jax-{version('jax')}-{version('jaxlib')}"
for name, value in {
    "XLA_FLAGS": " ".join(f"--{flag}={value}" for flag, value in QUICK.items()),
    "JAX_COMPILATION_CACHE_DIR": str(KEPT),
    "JAX_COMPILATION_CACHE_MAX_SIZE": str(2 * 1024**3),
    "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0.2",
    "JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES": "-1",
}.items():
    os.environ.setdefault(name, value)

import jax  # noqa: E402

from cloudjax_cli import held_memory  # noqa: E402
from tests import long_tests, slow_passes  # noqa: E402


jax.config.update("jax_numpy_rank_promotion", "raise")

# Files that share a fit, an image, a server, or all that they compile, which two
# workers would compile at the same time.
TOGETHER = {
    "tests/regression/test_fits.py": "fit",
    "tests/system/test_readme.py": "fit",
    "tests/unit/fit/test_checkpoint.py": "small fits",
    "tests/unit/fit/test_extreme_fits.py": "small fits",
    "tests/unit/fit/test_fitting.py": "small fits",
    "tests/unit/source_contract/test_batches.py": "sources",
    "tests/unit/source_contract/test_independence.py": "sources",
    "tests/unit/source_contract/test_parameters.py": "sources",
    "tests/regression/test_images.py": "image",
    "tests/system/test_render_sensor.py": "image",
    "tests/system/test_report_weather.py": "image",
    "tests/system/fetch/test_fetch_failures.py": "fetch",
    "tests/system/fetch/test_fetch_scene.py": "fetch",
}

# Bytes that a process holds before it forgets what the tests of a file compiled, and
# what the test of a file that goes on: the functions of all tests fill gigabytes.
ENOUGH, MUCH = 1.2e9, 2e9
# What a file's own fixtures hold, which is no reason to forget again.
kept = {"bytes": 0.0}


@pytest.fixture(scope="module", autouse=True)
def _forget_what_is_compiled():
    yield
    if _resident_bytes() > ENOUGH:
        _forget()


@pytest.fixture(autouse=True)
def _hold_little():
    yield
    if (
        held_memory.maps() > held_memory.MANY_MAPS
        or _resident_bytes() > MUCH + kept["bytes"]
    ):
        _forget()


def _forget() -> None:
    held_memory.forget()
    kept["bytes"] = max(_resident_bytes() - ENOUGH, 0.0)


def _resident_bytes() -> float:
    """Memory of this process; where the system does not tell, too much."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except OSError:
        return float("inf")
    return pages * os.sysconf("SC_PAGE_SIZE")


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real GOES and GFS files, or a skip where there is none."""
    folder = Path(os.environ.get("CLOUDJAX_DATA", ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no real files: {folder} is absent (set CLOUDJAX_DATA)")
    return folder


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--regression-update",
        action="store_true",
        help="replace what tests/regression has stored, and say what moved",
    )
    parser.addoption(
        "--find-long-tests",
        action="store_true",
        help="write tests/long_tests.txt anew for the files that are run",
    )
    parser.addoption(
        "--note-slow-passes",
        action="store_true",
        help="with -m slow: write the day into tests/slow_passes.txt",
    )


def pytest_configure(config: pytest.Config) -> None:
    # The worker of xdist that reports to nobody would write an empty list.
    if config.getoption("find_long_tests") and not hasattr(config, "workerinput"):
        config.pluginmanager.register(long_tests.Finder())
    if config.getoption("note_slow_passes") and not hasattr(config, "workerinput"):
        config.pluginmanager.register(slow_passes.Keeper())


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    long_tests.mark(items)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log):
    """Let the tests of a file run on one worker, for they share what is compiled.

    xdist's own groups are names in the ids of tests, which pytest 9.2 leaves out.
    """
    from xdist.scheduler import LoadScopeScheduling

    class ByFile(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file = nodeid.split("::")[0]
            return TOGETHER.get(file, file)

    return ByFile(config, log)


@pytest.fixture(scope="session")
def weather_folder(tmp_path_factory) -> Path:
    """Weather of two times and two classes of cloud."""
    from tests.weather_scenes import write_inputs

    return write_inputs(tmp_path_factory.mktemp("weather"))


@pytest.fixture(scope="session")
def rendered(weather_folder) -> Path:
    """The image over that weather."""
    from tests.weather_scenes import render_image

    return render_image(weather_folder, weather_folder / "out.nc")


@pytest.fixture(scope="session")
def example_of_a_fit(tmp_path_factory):
    """The fit of the README."""
    from tests.readme import run_fit

    return run_fit(tmp_path_factory.mktemp("readme"))
