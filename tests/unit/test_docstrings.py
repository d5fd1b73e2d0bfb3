"""What is public says what it does, in a sentence."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest


ROOT = Path(__file__).parents[2]
PACKAGES = (
    "src/cloudjax",
    "data_fetch/cloudjax_data",
    "scenes/cloudjax_scenes",
    "fit/cloudjax_fit",
)
FILES = sorted(path for folder in PACKAGES for path in (ROOT / folder).rglob("*.py"))
# A sentence that begins so has lost its subject and its verb.
OPENINGS = "of", "that of", "as", "such as", "with", "from", "per", "over", "where"
FRAGMENTS = tuple(f"{opening} " for opening in OPENINGS)


def _public(body: list[ast.stmt]) -> Iterator[ast.FunctionDef | ast.ClassDef]:
    for node in body:
        named = isinstance(node, ast.FunctionDef | ast.ClassDef)
        if named and not node.name.startswith("_"):
            yield node


def _classes(files: list[Path]) -> dict[str, ast.ClassDef]:
    return {
        node.name: node
        for path in files
        for node in ast.parse(path.read_text("utf-8")).body
        if isinstance(node, ast.ClassDef)
    }


CLASSES = _classes(FILES)


def _inherited(name: str, owner: ast.ClassDef) -> bool:
    """Tell whether a class above has a docstring for the method of that name."""
    names = [ast.unparse(base).split("[")[0] for base in owner.bases]
    above = [CLASSES[n] for n in names if n in CLASSES]
    return any(
        any(m.name == name and ast.get_docstring(m) for m in _public(c.body))
        or _inherited(name, c)
        for c in above
    )


def _undocumented(path: Path) -> Iterator[str]:
    """Name what a file offers without a word; overriding methods may inherit theirs."""
    for node in _public(ast.parse(path.read_text("utf-8")).body):
        if not ast.get_docstring(node):
            yield node.name
        if isinstance(node, ast.ClassDef):
            for method in _public(node.body):
                if not (ast.get_docstring(method) or _inherited(method.name, node)):
                    yield f"{node.name}.{method.name}"


def _fragments(path: Path) -> Iterator[str]:
    tree = ast.parse(path.read_text("utf-8"))
    for node in (tree, *_public(tree.body)):
        members = node.body if isinstance(node, ast.ClassDef) else []
        for part in (node, *_public(members)):
            text = ast.get_docstring(part) or ""
            if text.lower().startswith(FRAGMENTS):
                yield text.splitlines()[0]


each_file = pytest.mark.parametrize(
    "path", FILES, ids=lambda p: f"{p.parent.name}/{p.name}"
)


@each_file
def test_what_is_public_has_a_docstring(path):
    assert not list(_undocumented(path))


@each_file
def test_docstrings_begin_with_a_sentence(path):
    assert not list(_fragments(path))
