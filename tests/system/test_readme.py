"""The example in the README runs as it stands."""

import re
from pathlib import Path

import pytest


README = Path(__file__).parents[2] / "README.md"


def _examples() -> list[str]:
    text = README.read_text(encoding="utf-8")
    return re.findall(r"^```python\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize("code", _examples(), ids=lambda code: code.split("\n")[0])
def test_the_example_runs(code, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    exec(compile(code, str(README), "exec"), {"__name__": "__main__"})
    assert re.search(r"C13 .*W1/std \d\.\d{3}", capsys.readouterr().out)
    assert (tmp_path / "out" / "example" / "report.html").is_file()


def test_there_is_an_example():
    assert _examples()
