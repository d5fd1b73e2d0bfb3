"""An extension of griffe by which the reference shows the fields of equinox modules.

Every `equinox.Module` is a dataclass, but nothing in its source says so to a tool that
only reads it. What griffe knows of dataclasses then gives the signature.
"""

import griffe


class _Dataclass(griffe.Expr):
    @property
    def canonical_path(self) -> str:
        return "dataclasses.dataclass"

    def iterate(self, *, flat: bool = True):
        yield "dataclass"


class Modules(griffe.Extension):
    """Mark what comes from `eqx.Module`, or from an abstract class, as a dataclass."""

    def on_class_members(self, *, cls: griffe.Class, **_) -> None:
        bases = [str(base).split("[")[0].rsplit(".", 1)[-1] for base in cls.bases]
        if not any(base == "Module" or base.startswith("Abstract") for base in bases):
            return
        mark = griffe.Decorator(_Dataclass(), lineno=None, endlineno=None)
        cls.decorators.append(mark)
        for member in cls.members.values():
            if isinstance(member, griffe.Attribute):
                member.value = _default(member.value)


def _default(value: griffe.Expr | str | None) -> griffe.Expr | str | None:
    """Return the default that `eqx.field(...)` holds, or the value itself."""
    if not isinstance(value, griffe.ExprCall) or not str(value).startswith("eqx.field"):
        return value
    given = [a for a in value.arguments if isinstance(a, griffe.ExprKeyword)]
    return next((a.value for a in given if a.name == "default"), None)
