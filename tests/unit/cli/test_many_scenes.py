"""Many scenes: none stops another, and one table says what became of each."""

import csv
from dataclasses import dataclass

import numpy as np
import pytest
import xarray as xr

from cloudjax_cli.many_scenes import run_scenes
from cloudjax_cli.runners import Here
from cloudjax_data import DataError
from cloudjax_fit.outcome import Outcome
from cloudjax_fit.scene_summary import summary_dataset, write_summary


@dataclass(frozen=True)
class Told:
    """A task that does as it is told."""

    name: str
    state: str = "converged"
    raises: type[BaseException] | None = None
    at_once: bool = False

    def check(self) -> None:
        if self.at_once:
            self._fail()

    def __call__(self) -> Outcome:
        self._fail()
        return Outcome(self.name, self.state, "as told", 60.0)

    def _fail(self) -> None:
        if self.raises is not None:
            raise self.raises(f"{self.name} is no good: take another.")


def _states(folder) -> dict[str, str]:
    with (folder / "summary.csv").open(encoding="utf-8-sig", newline="") as file:
        return {row["scene"]: row["state"] for row in csv.DictReader(file)}


@pytest.mark.parametrize(
    ("other", "state", "code"),
    [
        (Told("b"), "converged", 0),
        (Told("b", "not converged"), "not converged", 1),
        (Told("b", raises=DataError), "failed", 2),
        (Told("b", raises=DataError, at_once=True), "failed", 2),
        (Told("b", raises=ZeroDivisionError), "fault of the program", 3),
    ],
)
def test_no_scene_stops_another(tmp_path, capsys, other, state, code):
    tasks = [Told("a"), other, Told("c")]
    assert run_scenes(tasks, Here(), tmp_path / "out", "Fits") == code
    assert _states(tmp_path / "out") == {"a": "converged", "b": state, "c": "converged"}
    shown = capsys.readouterr()
    assert f"3 of 3 scenes, {int(code > 1)} failed, 0 left: " in shown.out
    if code == 2:
        assert "b failed: b is no good: take another." in shown.err
    # What is found at once is told at once.
    if other.at_once:
        assert shown.err.startswith("1 of 3 scenes, 1 failed")


def test_an_interruption_writes_what_there_is(tmp_path):
    tasks = [Told("a"), Told("b", raises=KeyboardInterrupt), Told("c")]
    assert run_scenes(tasks, Here(), tmp_path, "Fits") == 130
    assert list(_states(tmp_path).values()) == ["converged", "not done", "not done"]
    tasks = [Told("a", "interrupted"), Told("b")]
    assert run_scenes(tasks, Here(), tmp_path, "Fits") == 130
    assert list(_states(tmp_path).values()) == ["interrupted", "not done"]


OUTCOMES = [
    Outcome("a", "converged", "in 3 steps", 12.5, 0.5, 0.25, {3: 0.1, 13: 0.2}, "a/r"),
    Outcome("b", "failed", 'no "file", at 10.3 µm\n<b>'),
]


def test_the_table_opens_in_a_spreadsheet(tmp_path):
    """As pandas and Excel read it: UTF-8 that says so, one line for a scene."""
    pandas = pytest.importorskip("pandas")
    page = write_summary(tmp_path, OUTCOMES, "Fits of <scenes>")
    table = pandas.read_csv(tmp_path / "summary.csv").set_index("scene")
    assert table.index.tolist() == ["a", "b"]
    assert table.loc["b", "reason"] == OUTCOMES[1].reason
    assert table.loc["a", "w1_over_std_C13"] == 0.2
    assert table.loc["a", "cloud_fraction_observed"] == 0.5
    assert table["converged"].tolist() == [1, 0]
    assert np.isnan(table.loc["b", "seconds"])
    assert (tmp_path / "summary.csv").read_bytes().startswith(b"\xef\xbb\xbfscene,")
    text = page.read_text(encoding="utf-8")
    assert "Fits of &lt;scenes&gt;" in text
    assert '<a href="a/r">a</a>' in text
    assert "1 converged, 1 failed." in text
    with xr.open_dataset(tmp_path / "summary.nc") as data:
        xr.testing.assert_equal(data.load(), summary_dataset(OUTCOMES))
