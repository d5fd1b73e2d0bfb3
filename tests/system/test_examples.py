"""The examples of the documentation run as they stand."""

import re
import runpy
from pathlib import Path

import pytest


ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text("utf-8")
BLOCKS = re.findall(r"^```python\n(.*?)^```", README, re.DOTALL | re.MULTILINE)
# What the README shows as well is run by its own test.
EXAMPLES = [
    path
    for path in sorted((ROOT / "docs/examples").glob("*.py"))
    if not any(block in path.read_text("utf-8") for block in BLOCKS)
]


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_the_example_runs(path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(path), run_name="__main__")
