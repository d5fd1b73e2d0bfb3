"""What was aimed at, beside what a run has found, as ratios."""

from collections.abc import Iterator

from .text import table


# Of the peers of Table 3 the quickest, and the paper's own size.
PEER, DISC = "Dr.Jit", "1000², 256³, 25 steps"
QUICKEST, MIDDLE = "2 steps, 1 node", "6 steps, 3 nodes"


def tables(parts: dict) -> str:
    """Of those targets whose parts were run."""
    lines = [
        [what, f"{found:.2g}{unit}", f"{must}{unit}", f"{aim}{unit}"]
        for what, found, must, aim, unit in _rows(parts)
    ]
    if not lines:
        return ""
    head = ["target", "measured", "must", "aim"]
    return "\n".join(["### Targets", "", table(head, lines), ""])


def _rows(parts: dict) -> Iterator[tuple[str, float, float, float, str]]:
    for row in parts.get("table3", {"rows": ()})["rows"]:
        yield from _of_disc(row)
    for entry in parts.get("derivatives", {"entries": ()})["entries"]:
        if "Jacobian" in entry["name"]:
            yield f"{entry['name']} over residuals", entry["ratio"], 4, 2, "x"


def _of_disc(row: dict) -> Iterator[tuple[str, float, float, float, str]]:
    entries = {e["name"]: e for e in row["entries"]}
    presets = [e for e in row["entries"] if not e["peer"]]
    peer = entries.get(PEER)
    if peer is not None and row["title"] == DISC:
        for name, must, aim in ((MIDDLE, 3, 6), (QUICKEST, 4, 8)):
            (preset,) = (e for e in presets if e["name"].endswith(name))
            as_good = all(preset[key] <= peer[key] for key in ("rmse", "w1"))
            what = f"whole picture against {PEER}, {name}"
            what += "" if as_good else " (errors larger)"
            yield what, peer["seconds"] / preset["everything_seconds"], must, aim, "x"
        if "ratio_march" in peer:
            what = f"prepared view against {PEER}, at equal or smaller error"
            yield what, peer["ratio_march"], 10, 20, "x"
        peak = max(e["peak_mb"] for e in presets) / 1e3
        yield f"peak memory, {DISC}", peak, 1, 0.5, " GB"
    if (paper := row["gtx1650_ms"]) == paper:
        quickest = min(e["everything_seconds"] for e in presets)
        what = f"{row['title']}, whole picture against the paper's GTX 1650"
        yield what, paper / 1e3 / quickest, 0.5, 1, "x"
