"""What may import what, and what importing must not do."""

import subprocess
import sys
from pathlib import Path

import pytest
from importlinter.application.use_cases import lint_imports
from importlinter.configuration import configure


ROOT = Path(__file__).parents[2]
PACKAGES = (
    "src/cloudjax",
    "data_fetch/cloudjax_data",
    "scenes/cloudjax_scenes",
    "fit/cloudjax_fit",
    "cli/cloudjax_cli",
)
FILES = sorted(p for folder in PACKAGES for p in (ROOT / folder).rglob("*.py"))
LONGEST = 400


def _python(code: str) -> str:
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_the_packages_keep_to_their_contracts(capsys, monkeypatch):
    monkeypatch.chdir(ROOT)
    configure()
    assert lint_imports(config_filename=str(ROOT / "pyproject.toml"), cache_dir=None), (
        capsys.readouterr().out
    )


NO_NETWORK = """
import socket
def refuse(*args, **kwargs):
    raise AssertionError("importing asked the network")
socket.socket.connect = socket.create_connection = socket.getaddrinfo = refuse
"""


def test_importing_the_renderer_changes_no_configuration_and_opens_no_network():
    found = _python(
        "import jax\nbefore = dict(jax.config.values)\n"
        + NO_NETWORK
        + "import cloudjax, cloudjax_fit\n"
        + "for package in (cloudjax, cloudjax_fit):\n"
        + "    assert [getattr(package, name) for name in dir(package)]\n"
        + "after = dict(jax.config.values)\n"
        + "print({k for k in after if after[k] != before.get(k, after[k])})"
    )
    assert found == "set()"


@pytest.mark.parametrize(
    "module",
    [
        *("cloudjax", "cloudjax.geometry.geodesy", "cloudjax.geometry.rays"),
        *("cloudjax.geometry.fixed_grid", "cloudjax.geometry.shells"),
        "cloudjax.light.planck",
    ],
)
def test_importing_what_needs_no_jax_loads_none(module):
    assert _python(f"import sys, {module}\nprint('jax' in sys.modules)") == "False"


def test_importing_the_data_package_loads_no_jax_and_opens_no_network():
    code = NO_NETWORK + "import sys, cloudjax_data\nprint('jax' in sys.modules)"
    assert _python(code) == "False"


def test_the_contracts_cover_the_rules_of_the_packages():
    """import-linter holds what pyproject.toml says; this holds what it must say."""
    text = (ROOT / "pyproject.toml").read_text()
    assert 'source_modules = ["cloudjax"]' in text
    assert 'source_modules = ["cloudjax_data"]' in text


@pytest.mark.parametrize("path", FILES, ids=lambda p: f"{p.parent.name}/{p.name}")
def test_no_file_is_longer_than_a_reader_bears(path):
    lines = len(path.read_text().splitlines())
    assert lines <= LONGEST
