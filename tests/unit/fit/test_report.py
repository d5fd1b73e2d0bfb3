import base64
import dataclasses
import json
import math
import re
import sys

import numpy as np
import pytest

from cloudjax_fit import figures
from cloudjax_fit.band_radiances import BandRadiances
from cloudjax_fit.comparison import compare
from cloudjax_fit.histogram import distances, quantiles
from cloudjax_fit.report import (
    BandReport,
    FitReport,
    ParameterRow,
    WeightedPixels,
    format_number,
    format_with_std,
    write_comparison,
    write_fit_report,
)
from cloudjax_scenes import display


UNITS = "mW m-2 sr-1 (cm-1)-1"


def _band(number=13, simulated=None) -> BandReport:
    rng = np.random.default_rng(number)
    image = rng.normal(55.0, 10.0, (30, 40))
    observed, start = quantiles(image.ravel()), image.ravel() - 30
    fitted = image.ravel() + 1 if simulated is None else simulated
    weights = np.linspace(0, 1, fitted.size)
    return BandReport(
        number=number,
        name=f"C{number} 10.3 µm",
        units=UNITS,
        observed=observed,
        simulated_start=WeightedPixels(start),
        simulated_fit=WeightedPixels(fitted, weights),
        distances_start=distances(observed, start),
        distances_fit=distances(observed, image.ravel() + 1, weights)
        if simulated is None
        else None,
        display=display.BRIGHTNESS_TEMPERATURE,
        observed_image=np.where(image > 60, math.nan, image),
        simulated_image=image.astype(np.float32),
    )


REPORT = FitReport(
    title="Fit of <GOES-17> & friends",
    scene={"platform": "GOES-17", "sun": "38° <above>"},
    status="The step became smaller than the tolerance.",
    converged=True,
    bands=[_band(13), _band(14)],
    parameters=[
        ParameterRow("low.threshold", 0.1234, 0.0056, 0.0, lower=-3.0, upper=3.0),
        ParameterRow("low.worley", 0.5, math.nan, determined=False, note="prior"),
        ParameterRow("high.top", 15999.0, 12.0, at_bound=True, unit="m"),
    ],
    undetermined=["low.worley + 0.8 low.threshold"],
    warnings=["Band 13 <script>alert(1)</script> stays apart."],
    history=[3.0, 0.4, 0.0, math.nan, 0.1],
    seconds={"compile": 1.25, "solve": 3.0},
    seeds={"textures": 7},
    versions={"cloudjax": "0.1.0"},
)


@pytest.fixture(scope="module")
def fit_page(tmp_path_factory):
    path = tmp_path_factory.mktemp("fit") / "report.html"

    def write(**changes) -> str:
        write_fit_report(path, dataclasses.replace(REPORT, **changes))
        return path.read_text(encoding="utf-8")

    return write


@pytest.fixture(scope="module")
def page(fit_page):
    return fit_page()


def test_the_page_needs_nothing_but_itself(page):
    sources = re.findall(r'(?:src|href)="([^"]{1,20})', page)
    assert sources
    assert all(s.startswith(("data:image/", "#band-")) for s in sources)
    assert not re.search(r"https?:|@import|url\(|<script|<link", page)


def test_text_is_escaped(page):
    assert "Fit of &lt;GOES-17&gt; &amp; friends" in page
    assert "&lt;script&gt;alert(1)&lt;/script&gt;" in page
    assert "38° &lt;above&gt;" in page


def test_the_page_says_all_that_the_report_holds(page):
    for text in (
        *("✓ Converged.", REPORT.status, "GOES-17", "C14 10.3 µm", "0.123 ± 0.006"),
        *("✓ yes", "✗ no", "⚠ at its bound", "low.worley + 0.8 low.threshold"),
        *("mW m⁻² sr⁻¹ (cm⁻¹)⁻¹", "1.25 s", "textures", "0.1.0", "−3.00 … 3.00"),
    ):
        assert text in page
    assert page.count("data:image/png") == 2
    assert page.count("data:image/svg+xml") == 5


def test_numbers_that_are_not_finite_become_dashes(fit_page):
    page = fit_page(bands=[], seconds={"compile": math.nan})
    assert "0.500 ± –" in page
    assert "<dd>– s</dd>" in page
    assert not re.search(r">\s*(nan|inf|None)\b", page)


def test_failure_is_marked_in_words(fit_page):
    page = fit_page(bands=[], converged=False, status="The loss is not finite.")
    assert "✗ Not converged." in page
    assert "✓ Converged." not in page


@pytest.mark.parametrize("simulated", [np.full(9, math.nan), np.zeros(0)])
def test_a_fit_that_went_wrong_still_gets_its_report(fit_page, simulated):
    page = fit_page(bands=[_band(simulated=simulated)], history=[math.nan])
    assert "“fit” hold no finite pixel" in page


def test_empty_parts_leave_no_headings(fit_page):
    page = fit_page(parameters=[], warnings=[], undetermined=[], versions={}, seeds={})
    for heading in ("Parameters", "Mind this", "Combinations", "Versions", "Seeds"):
        assert heading not in page


def test_equal_reports_give_equal_bytes(fit_page, page):
    assert fit_page() == page


def test_pyplot_is_not_touched(fit_page):
    loaded = "matplotlib.pyplot" in sys.modules
    fit_page(bands=[_band()])
    assert ("matplotlib.pyplot" in sys.modules) == loaded


def _bands(shift=0.0, number=13, units=UNITS, shape=(20, 30)):
    values = np.random.default_rng(0).normal(50, 10, shape) + shift
    values[..., 0] = math.nan
    return {number: BandRadiances(number, units, values)}


def test_a_comparison_is_a_page_and_the_same_numbers_as_json(tmp_path):
    comparison = compare(_bands(), _bands(2.5, shape=(600,)), ("a & b", "c"))
    write_comparison(tmp_path / "sub" / "report.html", comparison)
    assert sorted(p.name for p in (tmp_path / "sub").iterdir()) == [
        "report.html",
        "report.json",
    ]
    page = (tmp_path / "sub" / "report.html").read_text(encoding="utf-8")
    numbers = json.loads((tmp_path / "sub" / "report.json").read_text())
    band = numbers["bands"]["13"]
    assert (numbers["a"], numbers["b"], band["units"]) == ("a & b", "c", UNITS)
    assert (band["n_observed"], band["n_simulated"]) == (580, 599)
    assert format_number(band["w1"]) in page
    assert "a &amp; b" in page
    assert "Converged" not in page
    assert "Parameters" not in page


def test_json_holds_null_for_what_is_not_finite(tmp_path):
    flat = {1: BandRadiances(1, "W", np.ones((2, 2)))}
    write_comparison(tmp_path / "r.html", compare(flat, flat, ("a", "b")))
    numbers = json.loads((tmp_path / "r.json").read_text())
    assert numbers["bands"]["1"]["w1_over_std"] is None


@pytest.mark.parametrize(
    ("number", "text"),
    [
        (0.0, "0"),
        (123.4, "123"),
        (-0.01234, "−0.0123"),
        (0.9999, "1.00"),
        (101325, "101325"),
        (np.float32(0.5), "0.500"),
        (1.234e-5, "1.23 × 10⁻⁵"),
        (6.02e23, "6.02 × 10²³"),
        (math.nan, "–"),
        (-math.inf, "–"),
        (None, "–"),
    ],
)
def test_numbers_have_three_figures(number, text):
    assert format_number(number) == text


@pytest.mark.parametrize(
    ("value", "std", "text"),
    [
        (0.1234, 0.0056, "0.123 ± 0.006"),
        (0.1234, 0.00056, "0.1234 ± 0.0006"),
        (12.34, 4.12, "12.3 ± 4.1"),
        (0.52, 1.9, "0.5 ± 1.9"),
        (1e-9, 1.0, "0.0 ± 1.0"),
        (-2.0e7, 3.0e6, "(−2.00 ± 0.30) × 10⁷"),
        (15999.0, 12.3, "15999 ± 12"),
        (0.0, 0.1, "0.0 ± 0.1"),
        (-1.5, 0.0, "−1.50 ± 0.00"),
        (0.0, 0.0, "0 ± 0"),
        (1.23e-7, 4e-9, "(1.23 ± 0.04) × 10⁻⁷"),
        (1.5, math.inf, "1.50 ± –"),
        (1.5, None, "1.50 ± –"),
        (math.nan, 1.0, "–"),
    ],
)
def test_values_are_as_precise_as_their_deviation(value, std, text):
    assert format_with_std(value, std) == text


def _png_size(uri: str) -> tuple[int, int]:
    png = base64.b64decode(uri.removeprefix("data:image/png;base64,"))
    return int.from_bytes(png[16:20], "big"), int.from_bytes(png[20:24], "big")


@pytest.mark.parametrize(
    "image",
    [
        np.full((8, 8), math.nan),
        np.ones((1, 1)),
        np.zeros((3, 1500), np.float32),
        np.random.default_rng(0).normal(size=(1111, 700)),
    ],
)
def test_images_of_any_shape_are_drawn(image):
    uri = figures.images_figure([("one", image), ("two", image)], display.REFLECTANCE)
    assert max(_png_size(uri)) < 1200
