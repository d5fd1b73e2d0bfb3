"""Each row of docs/accuracy/extremes.md, with what physics says of it."""

from pathlib import Path

import pytest

from tests.extremes import ROWS


TABLE = Path(__file__).parents[2] / "docs/accuracy/extremes.md"


@pytest.mark.parametrize(
    "row",
    [
        pytest.param(row, id=row.name, marks=[pytest.mark.slow] * row.slow)
        for row in ROWS
    ],
)
def test_at_the_extreme(row):
    assert row.run()


def test_the_table_has_every_row():
    text = TABLE.read_text(encoding="utf-8")
    assert [row.name for row in ROWS if f"| {row.name} |" not in text] == []
