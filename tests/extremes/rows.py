"""The rows of the table, in the order in which they are written down."""

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """One line of the table.

    **Fields:** `slow`: whether it compiles a scene of its own.
    """

    group: str
    name: str
    run: Callable[[], str]
    slow: bool = False


ROWS: list[Row] = []


def row(group: str, name: str, *, slow: bool = False):
    def keep(run: Callable[[], str]) -> Callable[[], str]:
        ROWS.append(Row(group, name, run, slow))
        return run

    return keep
