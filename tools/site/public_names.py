"""A hook of mkdocs that lists the public names of a package on its reference page.

A line `[public names: cloudjax.geometry]` in a page of docs/reference is replaced by
one entry of mkdocstrings for each name that `cloudjax` re-exports from
`cloudjax.geometry`. So the reference follows the code.
"""

import ast
import re
from pathlib import Path


ROOT = Path(__file__).parents[2]
FOLDERS = ("src", "data_fetch", "scenes", "fit")
MARK = re.compile(r"^\[public names: ([\w.]+)\]$", re.MULTILINE)


def exported(package: str) -> dict[str, str]:
    """Return the names that a package re-exports, with the modules they come from."""
    (folder,) = (ROOT / f / package for f in FOLDERS if (ROOT / f / package).is_dir())
    # Packages that import late have a stub that says what they offer.
    stub = folder / "__init__.pyi"
    text = (stub if stub.exists() else folder / "__init__.py").read_text("utf-8")
    return {
        alias.asname: f"{package}.{node.module}"
        for node in ast.parse(text).body
        if isinstance(node, ast.ImportFrom) and node.level == 1
        for alias in node.names
        if alias.asname
    }


def names_of(room: str) -> list[str]:
    """Return the dotted public names that come from a package or a part of it."""
    package = room.split(".")[0]
    found = [
        f"{package}.{name}"
        for name, module in exported(package).items()
        if f"{module}.".startswith(f"{room}.")
    ]
    if not found:
        raise ValueError(f"{package} re-exports no name of {room}.")
    # functions before classes, as a reader meets them; constants last
    return sorted(found, key=_rank)


def _rank(name: str) -> tuple[int, str]:
    own = name.rsplit(".", 1)[1]
    return (2 if own.isupper() else 1 if own[0].isupper() else 0), own.lower()


def on_page_markdown(markdown: str, **_: object) -> str:
    """Replace the marks of a page, as mkdocs asks."""

    def entries(match: re.Match[str]) -> str:
        return "\n\n".join(f"::: {name}" for name in names_of(match[1]))

    return MARK.sub(entries, markdown)
