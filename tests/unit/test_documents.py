"""What documents name exists: links, commands and options, modules and names.

So does what scripts import.
"""

import ast
import functools as ft
import importlib
import re
import shlex
from pathlib import Path

import click
import pytest

from cloudjax_cli import main


ROOT = Path(__file__).parents[2]
PAGES = sorted(
    [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")], key=lambda p: p.as_posix()
)
# What a changelog names may be gone.
PRESENT = [page for page in PAGES if page.name != "CHANGELOG.md"]
SCRIPTS = sorted(p for d in ("benchmarks", "tools") for p in (ROOT / d).rglob("*.py"))
PACKAGES = ("src", "data_fetch", "scenes", "fit", "cli")
OFFERING = ("cloudjax", "cloudjax_data", "cloudjax_scenes", "cloudjax_fit")
SOURCES = (*PACKAGES, "tests", "tools", "benchmarks")
KINDS = (".py", ".pyi", ".toml", ".jinja", ".sh")

FENCE = re.compile(r"^```(\w*)[^\n]*\n(.*?)^```", re.DOTALL | re.MULTILINE)
CODE = re.compile(r"(?<!`)`([^`\n]+(?:\n[^`\n]+)?)`(?!`)")
LINK = re.compile(r"\]\(([^)\s]+)\)")
DOTTED = re.compile(r"\bcloudjax(?:_\w+)?(?:\.[A-Za-z_]\w*)+")
IDENTIFIER = re.compile(r"[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*(?:\(\))?")
# Options of other programs, and names from elsewhere that documents speak of.
OTHER_OPTIONS = {"--group"}
OTHER_WORDS = {
    *("IndirectLevenbergMarquardt", "Dogleg", "radis", "sasktran2", "landcheck"),
    *("RadM2", "CUDA_VISIBLE_DEVICES"),
    # what the code puts together from parts
    *("f009", "sun_gain", "_fit"),
}


def _each(pages: list[Path]) -> pytest.MarkDecorator:
    names = [page.relative_to(ROOT).as_posix() for page in pages]
    return pytest.mark.parametrize("page", pages, ids=names)


each_page, each_present_page = _each(PAGES), _each(PRESENT)


def _blocks(page: Path, *languages: str) -> list[str]:
    found = FENCE.findall(page.read_text("utf-8"))
    return [text for language, text in found if language in languages]


def _inline(page: Path) -> list[str]:
    """Return what stands between backticks in running text."""
    text = FENCE.sub("", page.read_text("utf-8"))
    return [" ".join(code.split()) for code in CODE.findall(text)]


@ft.cache
def _files() -> tuple[Path, ...]:
    """Return the files that a document may name."""
    here = [p for p in ROOT.iterdir() if p.is_file()]
    folders = (*SOURCES, "docs", ".ci", ".github")
    inside = [p for f in folders for p in (ROOT / f).rglob("*") if p.is_file()]
    return tuple(p for p in here + inside if "__pycache__" not in p.parts)


@ft.cache
def _vocabulary() -> frozenset[str]:
    """Return all words of the code, its tables and its build files."""
    code = [p for p in _files() if p.suffix in KINDS and p != Path(__file__)]
    code += [ROOT / "Makefile", ROOT / "pyproject.toml"]
    return frozenset(
        word
        for path in code
        for word in re.findall(r"[^\W\d]\w*", path.read_text("utf-8"))
    )


# Links ------------------------------------------------------------------------------


def _anchors(page: Path) -> set[str]:
    """Return the anchors of the headings, as GitHub and mkdocs make them."""
    text = FENCE.sub("", page.read_text("utf-8"))
    headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    plain = (re.sub(r"[^\w\s-]", "", h).strip().lower() for h in headings)
    return {re.sub(r"\s", "-", h) for h in plain} | {
        re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", h).strip().lower())
        for h in headings
    }


@each_page
def test_relative_links_lead_somewhere(page):
    text = FENCE.sub("", page.read_text("utf-8"))
    for link in LINK.findall(text):
        if re.match(r"[a-z]+:", link):
            continue
        path, _, anchor = link.partition("#")
        target = page if not path else (page.parent / path).resolve()
        assert target.exists(), f"{link} leads nowhere"
        if anchor:
            assert anchor in _anchors(target), f"{link}: no such heading"


def test_comments_name_documents_that_exist():
    for path in _files():
        if path.suffix in KINDS and path != Path(__file__):
            for named in re.findall(r"\bdocs/[\w/]+\.\w+", path.read_text("utf-8")):
                assert (ROOT / named).exists(), f"{path.relative_to(ROOT)}: {named}"


def test_every_page_is_in_the_navigation():
    listed = set(re.findall(r"[\w/]+\.md", (ROOT / "mkdocs.yml").read_text("utf-8")))
    docs = ROOT / "docs"
    assert listed == {p.relative_to(docs).as_posix() for p in docs.rglob("*.md")}


# Commands ---------------------------------------------------------------------------


def _commands(page: Path) -> list[str]:
    """Return the lines of shell that call cloudjax."""
    shell = "\n".join(_blocks(page, "", "sh", "bash", "console"))
    lines = shell.replace("\\\n", " ").splitlines() + _inline(page)
    return [s for line in lines if (s := line.strip()).startswith("cloudjax ")]


def _options(command: click.Command) -> dict[str, click.Parameter]:
    return {
        name: parameter
        for parameter in command.params
        for name in (*parameter.opts, *parameter.secondary_opts)
    } | {"--help": None, "-h": None}  # pyright: ignore[reportReturnType]


def _check_call(line: str) -> None:
    """Walk from group to command, and look up each option where it stands."""
    words = shlex.split(line, comments=True)[1:]
    command: click.Command = main
    while words:
        word = words.pop(0)
        if word.startswith("-"):
            name = word.split("=")[0]
            options = _options(command)
            assert name in options, f"{command.name} has no {name}: {line}"
            value = options[name]
            if isinstance(value, click.Option) and not value.is_flag and words:
                words.pop(0)
        elif isinstance(command, click.Group) and word.isalnum():
            assert word in command.commands, f"there is no {word}: {line}"
            command = command.commands[word]


@each_page
def test_commands_and_their_options_exist(page):
    for line in _commands(page):
        # `cloudjax fetch scene|goes|gfs` names three of them.
        several = re.search(r"\b\w+(?:\|\w+)+\b", line)
        names = several[0].split("|") if several else [""]
        if not all(name.islower() for name in names):
            names = [names[0]]
        for name in names:
            _check_call(line.replace(several[0], name) if several else line)


def _all_options(command: click.Command) -> set[str]:
    below = command.commands.values() if isinstance(command, click.Group) else ()
    return {o for o in _options(command) if o.startswith("--")}.union(
        *(_all_options(c) for c in below)
    )


@each_page
def test_options_named_alone_exist(page):
    """Of cloudjax, or of a script in tools or benchmarks."""
    scripts = "\n".join(
        p.read_text("utf-8")
        for p in _files()
        if p.suffix == ".py" and p.relative_to(ROOT).parts[0] in ("tools", "benchmarks")
    )
    known = _all_options(main) | OTHER_OPTIONS | set(re.findall(r"--[a-z-]+", scripts))
    for code in _inline(page):
        for option in re.findall(r"(?:^|(?<=\s))--[a-z][a-z-]*", code):
            assert option in known, f"`{code}`"


@each_page
def test_targets_of_make_exist(page):
    makefile = (ROOT / "Makefile").read_text("utf-8")
    text = "\n".join([*_blocks(page, "", "sh"), *_inline(page)])
    for target in re.findall(r"^make ([a-z][\w-]*)", text, re.MULTILINE):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), f"make {target}"


# Names ------------------------------------------------------------------------------


def _resolve(dotted: str) -> None:
    """Import the longest module of a dotted name, and look the rest up in it."""
    parts = dotted.split(".")
    for i in range(len(parts), 0, -1):
        name = ".".join(parts[:i])
        try:
            found = importlib.import_module(name)
        except ModuleNotFoundError as error:
            if error.name is not None and name.startswith(error.name):
                continue
            raise
        for attribute in parts[i:]:
            found = getattr(found, attribute)
        return
    raise ModuleNotFoundError(dotted)


@each_present_page
def test_dotted_names_exist(page):
    codes = [c for c in _inline(page) if not c.endswith((".py", ".toml"))]
    for name in {n for code in codes for n in DOTTED.findall(code)}:
        _resolve(name)


@each_present_page
def test_members_of_public_classes_exist(page):
    """`Class.member`, for what a package offers."""
    offered = [importlib.import_module(name) for name in OFFERING]
    for code in _inline(page):
        if match := re.match(r"([A-Z]\w+)\.([a-z]\w*)", code):
            classes = [getattr(package, match[1], None) for package in offered]
            for found in filter(None, classes):
                fields = getattr(found, "__dataclass_fields__", {})
                assert match[2] in fields or hasattr(found, match[2]), f"`{code}`"


def _check_imports(code: str) -> None:
    """Find what is imported from the packages, at the top or within functions."""
    for node in ast.walk(ast.parse(code)):
        module = getattr(node, "module", None) or ""
        if isinstance(node, ast.ImportFrom) and module.startswith("cloudjax"):
            for alias in node.names:
                _resolve(f"{module}.{alias.name}")


@each_present_page
def test_examples_import_what_exists(page):
    for code in _blocks(page, "python"):
        _check_imports(code)


@_each(SCRIPTS)
def test_scripts_import_what_exists(page):
    """They take minutes, and some need what is not installed: no test runs them all."""
    _check_imports(page.read_text("utf-8"))


def _is_file(word: str) -> bool:
    """Tell whether a path, or the lone name of a module, is that of a file here."""
    if "/" in word and word.split("/")[0] in (*SOURCES, "docs"):
        return (ROOT / word).exists()
    return not re.fullmatch(r"\w+\.py", word) or word in {p.name for p in _files()}


@each_present_page
def test_named_files_exist(page):
    words = [word for code in _inline(page) for word in code.split()]
    assert not [word for word in words if not _is_file(word)]


@each_present_page
def test_identifiers_occur_in_the_code(page):
    """A name that no file of the code has is stale, or that of another program."""
    known = _vocabulary() | OTHER_WORDS
    files = {p.name for p in _files()}
    names = [c for c in _inline(page) if IDENTIFIER.fullmatch(c) and c not in files]
    # The parameters of a band end with its number: `air.path_C01`.
    words = {n: re.findall(r"\w+", re.sub(r"_C\d\d\b", "", n)) for n in names}
    assert not [name for name, parts in words.items() if not known.issuperset(parts)]
