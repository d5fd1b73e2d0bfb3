"""The picture of a run: error against time, and how cost grows."""

from pathlib import Path

from matplotlib.figure import Figure
from peers import ours


COLOURS = {"JAX, straightforward": "C1", "numba": "C2", "Dr.Jit": "C3"}


def draw(parts: dict, path: Path) -> None:
    """What there is of the parts: a panel for each row of Table 3, one for scaling."""
    rows = parts.get("table3", {}).get("rows", [])
    scans = parts.get("scaling", {}).get("scans", {})
    count = len(rows) + bool(scans)
    if count == 0:
        return
    figure = Figure(figsize=(3.6 * count, 3.4), layout="constrained")
    panels = figure.subplots(1, count, squeeze=False)[0]
    for axes, row in zip(panels, rows, strict=False):
        draw_row(axes, row)
    if scans:
        draw_scans(panels[-1], scans)
    for axes in panels:
        axes.grid(alpha=0.3, which="both")
        axes.legend(fontsize=7)
    figure.savefig(path, dpi=110, metadata={"Software": None})


def draw_row(axes, row: dict) -> None:
    presets = [e for e in row["entries"] if not e["peer"]]
    errors = [e["rmse"] for e in presets]
    for label, key, line in (
        ("march", "seconds", "-o"),
        ("everything", "everything_seconds", "--o"),
    ):
        axes.plot(
            [e[key] for e in presets],
            errors,
            line,
            color="C0",
            markersize=3,
            label=f"{ours.NAME}, {label}",
        )
    for entry in row["entries"]:
        if entry["peer"]:
            axes.plot(
                entry["seconds"],
                entry["rmse"],
                "s",
                color=COLOURS[entry["name"]],
                label=entry["name"],
            )
    axes.set(title=row["title"], xlabel="s", ylabel="RMSE of reflectance", xscale="log")
    axes.set_ylim(bottom=0)
    axes.title.set_fontsize(9)


def draw_scans(axes, scans: dict) -> None:
    for name, scan in scans.items():
        ratio = [v / scan["values"][0] for v in scan["values"]]
        cost = [s / scan["seconds"][0] for s in scan["seconds"]]
        axes.loglog(ratio, cost, "-o", markersize=3, label=name)
    most = max(s["values"][-1] / s["values"][0] for s in scans.values())
    axes.loglog([1, most], [1, most], ":", color="grey", label="in proportion")
    axes.set(title="Scaling", xlabel="work", ylabel="time of the march")
    axes.title.set_fontsize(9)
