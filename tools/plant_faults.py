"""This command plants the faults of tests/faults.toml, one by one, and says which of
them their tests find: `python -m tools.plant_faults [--only TEXT]`.

A fault is planted in a copy of the tracked files, in a temporary folder. A test that
ends by an error of another kind than an assertion has found nothing: the next change
may let it pass.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path

import click


ROOT = Path(__file__).parents[1]
TABLE = ROOT / "tests" / "faults.toml"
# Where Python finds what it imports, before what is installed.
IMPORTED = ("src", "data_fetch", "scenes", "fit", "cli", ".")
# How messages of `assert`, of comparisons by numpy and of pytest's own `raises` begin.
ASSERTIONS = ("assert ", "AssertionError", "Failed")
LONGEST_S = 900
PASSES, FAILS = "passes", "fails"


@dataclass(frozen=True)
class Fault:
    """A `Fault` is a change that makes the code wrong, and the test that finds it.

    **Fields:**

    - `part`: the heading that it stands under; `fault`: what is wrong, in words.
    - `file`: path from the root; `find`: text that it has once; `replace`: what is
      planted there.
    - `test`: as pytest names it.
    """

    part: str
    fault: str
    file: str
    find: str
    replace: str
    test: str

    def planted(self, text: str) -> str:
        """Return the text of the file with the fault.

        **Raises:** `ValueError` unless what is looked for is there once.
        """
        count = text.count(self.find)
        if count != 1:
            raise ValueError(f"{self.file} has what is replaced {count} times")
        return text.replace(self.find, self.replace)


def read_faults() -> list[Fault]:
    """Read the table."""
    parts = tomllib.loads(TABLE.read_text(encoding="utf-8"))
    return [Fault(part, **row) for part, rows in parts.items() for row in rows]


def copy_tracked(folder: Path) -> None:
    """Copy the files that git knows, as they are in the working tree."""
    listed = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    for name in listed.stdout.split("\0"):
        if name and (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)


def verdict(folder: Path, test: str) -> str:
    """Run a test in a copy, and return `PASSES`, `FAILS` or in words how it ended."""
    report = folder / "report.xml"
    report.unlink(missing_ok=True)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    try:
        done = subprocess.run(
            [*command, f"--junitxml={report}", test],
            cwd=folder,
            env=_environment(folder),
            capture_output=True,
            text=True,
            timeout=LONGEST_S,
        )
    except subprocess.TimeoutExpired:
        return f"has not ended after {LONGEST_S} s"
    if not report.exists():
        return f"has not begun: {(done.stdout + done.stderr)[-200:]}"
    return ended(list(ET.parse(report).iter("testcase")))


def _environment(folder: Path) -> dict[str, str]:
    kept = {"JAX_COMPILATION_CACHE_DIR": str(ROOT / ".pytest_cache" / "faults")}
    own = {
        "PYTHONPATH": os.pathsep.join(str(folder / name) for name in IMPORTED),
        # A file that is changed twice within a second looks unchanged.
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    return kept | os.environ | own


def ended(cases: list[ET.Element]) -> str:
    """Say how the cases of a test ended, by the report of pytest, as `verdict`."""
    wrong = [
        part for kind in ("failure", "error") for c in cases for part in c.iter(kind)
    ]
    if any(
        part.tag == "failure" and part.get("message", "").startswith(ASSERTIONS)
        for part in wrong
    ):
        return FAILS
    if wrong:
        return f"breaks: {wrong[0].get('message', '')[:200]}"
    if all(case.find("skipped") is not None for case in cases):
        return "has run nothing"
    return PASSES


def plant(folder: Path, fault: Fault, unplanted: dict[str, str]) -> str:
    """Plant a fault in a copy, run its test, and return "found" or in words why not.

    **Arguments:** `unplanted`: how tests end without a fault, as far as they have run.
    """
    file = folder / fault.file
    try:
        text = file.read_text(encoding="utf-8")
        wrong = fault.planted(text)
    except (OSError, ValueError) as error:
        return f"NOT PLANTED, {error}"
    if fault.test not in unplanted:
        unplanted[fault.test] = verdict(folder, fault.test)
    if unplanted[fault.test] != PASSES:
        return f"NOT PLANTED, without it the test {unplanted[fault.test]}"
    try:
        file.write_text(wrong, encoding="utf-8")
        said = verdict(folder, fault.test)
    finally:
        file.write_text(text, encoding="utf-8")
    words = {FAILS: "found", PASSES: "SURVIVED"}
    return words.get(said, f"SURVIVED, the test {said}")


@click.command()
@click.option(
    "--only",
    default="",
    metavar="TEXT",
    help="Of the faults, those that have this in their heading, words, file or test.",
)
def main(only: str) -> None:
    """Plant the faults of tests/faults.toml, and say which their tests find."""
    every = read_faults()
    faults = [f for f in every if only in "\n".join((f.part, f.fault, f.file, f.test))]
    if not faults:
        raise click.UsageError(f"no fault has {only!r} in its words, file or test")
    missed, unplanted = 0, {}
    with tempfile.TemporaryDirectory() as name:
        copy_tracked(Path(name))
        for fault in faults:
            began = time.perf_counter()
            said = plant(Path(name), fault, unplanted)
            missed += said != "found"
            took = time.perf_counter() - began
            click.echo(f"{said}: {fault.fault} ({fault.file}, {took:.0f} s)")
            if said != "found":
                click.echo(f"    {fault.test}")
    click.echo(f"{len(faults)} faults, {missed} not found")
    sys.exit(missed > 0)


if __name__ == "__main__":
    main()
