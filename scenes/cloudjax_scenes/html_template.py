"""Templates of HTML pages that open offline."""

import importlib.resources
from collections.abc import Callable, Mapping
from typing import Any

import jinja2


def html_template(
    package: str, name: str, filters: Mapping[str, Callable[..., Any]] | None = None
) -> jinja2.Template:
    """Read a template of a package; what it is given is escaped, and all is needed.

    **Arguments:** `filters`: that it may use besides those of jinja2, by name.
    """
    environment = jinja2.Environment(
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= filters or {}
    file = importlib.resources.files(package) / name
    return environment.from_string(file.read_text(encoding="utf-8"))
