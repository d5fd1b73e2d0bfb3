"""The benchmark runs from end to end, on little work and without optional peers."""

import json
import subprocess
import sys
from pathlib import Path

import pytest


ROOT = Path(__file__).parents[2]


def bench(*options: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "benchmarks/bench.py", *map(str, options)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.slow
def test_a_quick_benchmark_writes_its_tables(tmp_path):
    done = bench("--quick", "-o", tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "bench.json").read_text())
    (row,) = found["parts"]["table3"]["rows"]
    peer, ours = row["entries"]
    assert peer["peer"]
    assert min(peer["seconds"], ours["seconds"], *ours["view_seconds"].values()) > 0
    # One hard ray sees a point of a pixel of hundreds of kilometres.
    assert 0 < ours["rmse"] < peer["rmse"] < 0.5
    assert "brute" not in (tmp_path / "bench.md").read_text()
    assert (tmp_path / "bench.png").is_file()
    assert found["machine"]["cores"] in (tmp_path / "bench.md").read_text()


def test_the_parts_that_render_nothing_write_their_tables(tmp_path):
    """What stands in for the whole: two maps of one wind, and the start of commands."""
    done = bench("--quick", "--only", "displacement,startup", "-o", tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "bench.json").read_text())
    assert list(found["parts"]) == ["displacement", "startup"]
    assert 0 < found["parts"]["displacement"]["apart_m"] < 50
    text = (tmp_path / "bench.md").read_text()
    assert found["machine"]["cores"] in text
    assert "Displacement map of 5.0°" in text


def test_a_part_that_does_not_exist_is_refused():
    done = bench("--only", "table4")
    assert done.returncode == 2
    assert "table4" in done.stderr
