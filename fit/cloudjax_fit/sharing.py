"""Which parameters the scenes of a joint fit have in common."""

import fnmatch
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from importlib.resources import files

from cloudjax.toml_table import FLAG, TABLE, TomlError, read_toml, require_known
from cloudjax_data import DataError
from cloudjax_scenes.data_errors import data_errors

from .fittable_scene import FittableScene
from .parameters import Parameter


@dataclass(frozen=True)
class Sharing:
    """Patterns of names and whether such parameters are shared; the first decides.

    Every name fits one of them.
    """

    rules: Mapping[str, bool]

    def shares(self, name: str) -> bool:
        """Tell whether scenes have this parameter in common."""
        fitting = (p for p in self.rules if fnmatch.fnmatchcase(name, p))
        return self.rules[next(fitting)]


@data_errors()
def read_sharing(path: str | os.PathLike[str] | None = None) -> Sharing:
    """Read a table of what is shared; its lines come before those of the default.

    **Arguments:** `path`: a TOML file with a section `shared`; None for the default.

    **Raises:** `DataError` for a file that cannot be used.
    """
    usual = _rules(files("cloudjax_fit") / "sharing.toml")
    given = {} if path is None else _rules(path)
    return Sharing(given | {p: s for p, s in usual.items() if p not in given})


def _rules(path) -> dict[str, bool]:
    source = str(path)
    content = read_toml(path, "a table of what a joint fit shares")
    require_known(content, ("shared",), "section", source)
    table = content.get("shared", {})
    if not TABLE.holds(table):
        raise TomlError(f"{source} gives shared = {table!r}: make it a section.")
    return {name: FLAG.check(value, name, source) for name, value in table.items()}


@dataclass(frozen=True)
class JoinedParameters:
    """`JoinedParameters` are those of several scenes, each shared one once.

    **Fields:**

    - `parameters`: free ones; those that a scene has for itself are called
      "SCENE: NAME".
    - `shared`: names of those that are in common.
    - `places`: where the free parameters of each scene are among them.
    """

    parameters: list[Parameter]
    shared: list[str]
    places: list[list[int]]


def join(scenes: Sequence[FittableScene], sharing: Sharing) -> JoinedParameters:
    """Join the parameters of scenes.

    **Raises:** `DataError` if scenes say different things of one that they share.
    """
    found: dict[str, Parameter] = {}
    first: dict[str, tuple[Parameter, str]] = {}
    places = []
    for scene in scenes:
        own = []
        for parameter in scene.parameters:
            key = parameter.name
            if sharing.shares(key):
                _require_alike(*first.setdefault(key, (parameter, scene.name)),
                               parameter, scene.name)  # fmt: skip
            else:
                key = f"{scene.name}: {key}"
            if parameter.free:
                found.setdefault(key, parameter)
                own.append(list(found).index(key))
        places.append(own)
    shared = [name for name in found if name in first]
    return JoinedParameters(list(_named(found)), shared, places)


def _named(found: Mapping[str, Parameter]) -> Iterator[Parameter]:
    for name, parameter in found.items():
        yield replace(parameter, name=name)


def _require_alike(first: Parameter, of: str, second: Parameter, other: str) -> None:
    for each in fields(Parameter):
        a, b = (getattr(p, each.name) for p in (first, second))
        if a != b:
            raise DataError(
                f"{of} and {other} have different values of {each.name} for "
                f"{first.name}, {a} and {b}, and share it: set it in both, or have "
                f'"{first.name}" = false among what is shared.'
            )
