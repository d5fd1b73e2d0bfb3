"""Write the table of docs/accuracy/extremes.md: `python -m tools.make_extremes`.

All rows are measured, which takes some minutes; a row that does not hold stops it.
"""

import itertools
from pathlib import Path

from tests.extremes import ROWS


PAGE = Path(__file__).parents[1] / "docs/accuracy/extremes.md"
BEGIN, END = "<!-- rows -->", "<!-- end of rows -->"


def table() -> str:
    lines = []
    for group, rows in itertools.groupby(ROWS, key=lambda row: row.group):
        lines += [f"\n## {group}\n", "| extreme | what happens |", "| --- | --- |"]
        for row in rows:
            said = row.run()
            print(f"{row.name}: {said}", flush=True)
            lines.append(f"| {row.name} | {said} |")
    return "\n".join(lines)


def main() -> None:
    before, rest = PAGE.read_text(encoding="utf-8").split(BEGIN)
    after = rest.split(END)[1]
    text = f"{before}{BEGIN}\n{table()}\n\n{END}{after}"
    PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
