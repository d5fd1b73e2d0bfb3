"""Changes of TOML files, one at a time: `apply` takes the text and returns bytes."""

import re
from collections.abc import Iterator

from .verdict import Mutation


VALUES = {
    "a text": '"wrong"',
    "an empty text": '""',
    "negative": "-3",
    "zero": "0",
    "a half": "0.5",
    "infinite": "inf",
    "not a number": "nan",
    "true": "true",
    "false": "false",
    "an empty list": "[]",
    "a list": '[1, "two"]',
    "a list of lists": "[[1], [2]]",
    "a table": "{ a = 1 }",
    "a date": "2019-10-27T20:00:00",
    "an hour": "20:00:00",
    "huge": "1e308",
    "a huge whole number": "100000000000000000000000000",
    "nothing": "",
    "beyond all floats": "9" * 400,
    "a number of many digits": "9" * 5000,
    "a deep list": "[" * 3000 + "]" * 3000,
}
_KEY = re.compile(r"^(?P<key>[\w.\"-]+)(?P<between> *= *)(?P<value>[^#\n]*)", re.M)
_HEADER = re.compile(r"^\[+(?P<name>[^\]\n]+)\]+", re.M)


def toml_mutations(text: str, *, keys: int | None = None) -> list[Mutation]:
    """All changes of a text, of so many of its keys at most."""
    found = list(_KEY.finditer(text))
    step = 1 if keys is None else max(len(found) // keys, 1)
    return [*_of_keys(found[::step]), *_of_headers(text), *_of_text(len(text))]


def _of_keys(found: list[re.Match]) -> Iterator[Mutation]:
    for match in found:
        key, (start, end) = match["key"], match.span()
        line = match[0]
        replacements = {
            f"no {key}": "",
            f"{key} twice": f"{line}\n{line}",
            f"{key} misspelt": f"x{line}",
            f"{key} in capitals": line.upper(),
        } | {
            f"{key} {what}": f"{key}{match['between']}{value}"
            for what, value in VALUES.items()
        }
        for name, new in replacements.items():
            yield Mutation(
                f"{name} at {start}",
                lambda text, a=start, b=end, n=new: _put(text, a, b, n),
            )


def _of_headers(text: str) -> Iterator[Mutation]:
    for match in list(_HEADER.finditer(text))[:6]:
        start, end = match.span()
        replacements = {
            "gone": "",
            "twice": f"{match[0]}\n{match[0]}",
            "misspelt": match[0].replace("[", "[x", 1),
            "open": match[0].rstrip("]"),
            "within another": match[0].replace("]", ".inner]", 1),
        }
        for what, new in replacements.items():
            yield Mutation(
                f"section {match['name']} {what}",
                lambda text, a=start, b=end, n=new: _put(text, a, b, n),
            )


def _of_text(size: int) -> Iterator[Mutation]:
    for percent in range(0, 100, 7):
        at = size * percent // 100
        yield Mutation(f"cut at {at}", lambda t, a=at: t[:a].encode())
        yield Mutation(
            f"a zero byte at {at}", lambda t, a=at: f"{t[:a]}\0{t[a:]}".encode()
        )
    for encoding in ("utf-8-sig", "utf-16", "utf-32", "utf-16-le", "cp037"):
        yield Mutation(f"in {encoding}", lambda t, e=encoding: t.encode(e))
    yield Mutation("with Windows ends", lambda t: t.replace("\n", "\r\n").encode())
    yield Mutation("with bytes of Latin-1", lambda t: t.encode() + b"# \xfc\n")
    yield Mutation("a page of a web server", lambda t: b"<html>404</html>")
    yield Mutation("twice", lambda t: (t + t).encode())


def _put(text: str, start: int, end: int, new: str) -> bytes:
    return (text[:start] + new + text[end:]).encode()
