"""One table of many scenes: what became of each, for spreadsheets and for a browser."""

import csv
import io
import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from cloudjax_data.whole_files import staged
from cloudjax_scenes.html_template import html_template
from cloudjax_scenes.netcdf import write_netcdf

from .fit_result import CONVERGED
from .outcome import GOOD, STATES, Outcome
from .report import ParameterRow, format_number, format_with_std


# By what is in it.
TABLE, PAGE, DATA = "summary.csv", "summary.html", "summary.nc"


def summary_dataset(outcomes: Sequence[Outcome]) -> xr.Dataset:
    """Return the table as a Dataset on `scene`, and on `band` what each band has."""
    bands = sorted({band for one in outcomes for band in one.w1_over_std})
    distances = [[o.w1_over_std.get(b, math.nan) for b in bands] for o in outcomes]
    share = {"units": "1"}
    columns = {
        "state": ([o.state for o in outcomes], {"long_name": "how it ended"}),
        "reason": ([o.reason for o in outcomes], {"long_name": "why, in a sentence"}),
        "converged": ([int(o.state == CONVERGED) for o in outcomes], {}),
        "seconds": ([o.seconds for o in outcomes], {"units": "s"}),
        "cloud_fraction_observed": ([o.observed_cloud for o in outcomes], share),
        "cloud_fraction_simulated": ([o.simulated_cloud for o in outcomes], share),
    }
    return xr.Dataset(
        {
            **{n: ("scene", np.array(v), attrs) for n, (v, attrs) in columns.items()},
            "w1_over_std": (
                ("scene", "band"),
                np.array(distances, float).reshape(len(outcomes), len(bands)),
                {"units": "1", "long_name": "1-Wasserstein distance over deviation"},
            ),
        },
        coords={"scene": [o.name for o in outcomes], "band": np.array(bands, int)},
        attrs={"Conventions": "CF-1.8", "title": "Summary of scenes"},
    )


def write_summary(
    folder: str | os.PathLike[str],
    outcomes: Sequence[Outcome],
    title: str,
    shared: Sequence[ParameterRow] = (),
) -> Path:
    """Write the table as CSV, HTML and netCDF, and return the path of the page.

    **Arguments:** `shared`: parameters that the scenes have in common.

    **Raises:** `DataError` if the disk does not take them.
    """
    data = summary_dataset(outcomes)
    with staged(folder, last=PAGE) as aside:
        # The mark tells spreadsheets that it is UTF-8.
        (aside / TABLE).write_text(_csv(data), encoding="utf-8-sig", newline="")
        write_netcdf(aside / DATA, data)
        pages = [one.page for one in outcomes]
        filters = {"number": format_number, "with_std": format_with_std}
        template = html_template("cloudjax_fit", "scene_summary.html.jinja", filters)
        page = template.render(
            title=title,
            columns=[name for name in _columns(data) if name != "converged"],
            rows=zip(pages, _rows(data), strict=True),
            counts={s: n for s in STATES if (n := _count(outcomes, s))},
            good=GOOD,
            shared=shared,
        )
        (aside / PAGE).write_text(page, encoding="utf-8")
    return Path(folder) / PAGE


def _count(outcomes: Sequence[Outcome], state: str) -> int:
    return sum(one.state == state for one in outcomes)


def _columns(data: xr.Dataset) -> dict[str, np.ndarray]:
    """A column for each variable, and of those by band for each band."""
    columns = {"scene": data["scene"].values}
    for name, variable in data.data_vars.items():
        if "band" not in variable.dims:
            columns[str(name)] = variable.values
            continue
        for band in data["band"].values:
            columns[f"{name}_C{band:02d}"] = variable.sel(band=band).values
    return columns


def _rows(data: xr.Dataset) -> list[dict[str, Any]]:
    columns = _columns(data)
    return [
        {name: _plain(values[i]) for name, values in columns.items()}
        for i in range(data.sizes["scene"])
    ]


def _csv(data: xr.Dataset) -> str:
    text = io.StringIO(newline="")
    table = csv.DictWriter(text, list(_columns(data)))
    table.writeheader()
    table.writerows(_rows(data))
    return text.getvalue()


def _plain(value: Any) -> Any:
    """A value as a table shows it: nothing where there is none."""
    value = value.item() if isinstance(value, np.generic) else value
    if not isinstance(value, float):
        return value
    return float(f"{value:.6g}") if math.isfinite(value) else ""
