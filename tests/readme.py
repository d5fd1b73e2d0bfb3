"""The examples of the README, as they stand."""

import contextlib
import io
import re
from dataclasses import dataclass
from pathlib import Path


README = Path(__file__).parents[1] / "README.md"


@dataclass(frozen=True)
class ExampleRun:
    """What an example printed, and the folder that it ran in."""

    output: str
    folder: Path


def examples() -> list[str]:
    text = README.read_text(encoding="utf-8")
    return re.findall(r"^```python\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


def is_fit(code: str) -> bool:
    return "write_fit" in code


def run(code: str, folder: Path) -> ExampleRun:
    output = io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(output):
        exec(compile(code, str(README), "exec"), {"__name__": "__main__"})
    return ExampleRun(output.getvalue(), folder)


def run_fit(folder: Path) -> ExampleRun:
    (code,) = filter(is_fit, examples())
    return run(code, folder)
