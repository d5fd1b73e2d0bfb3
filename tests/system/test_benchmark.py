"""The benchmark runs from end to end, on little work and without optional peers."""

import json
import subprocess
import sys
from pathlib import Path


ROOT = Path(__file__).parents[2]


def test_a_quick_benchmark_writes_its_tables(tmp_path):
    done = subprocess.run(
        [sys.executable, "benchmarks/bench.py", "--quick", "-o", str(tmp_path)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "bench.json").read_text())
    (row,) = found["parts"]["table3"]["rows"]
    peer, ours = row["entries"]
    assert peer["peer"]
    assert min(peer["seconds"], ours["seconds"], *ours["view_seconds"].values()) > 0
    # One hard ray sees a point of a pixel of hundreds of kilometres.
    assert 0 < ours["rmse"] < peer["rmse"] < 0.5
    assert "brute" not in (tmp_path / "bench.md").read_text()
    assert found["machine"]["cores"] in (tmp_path / "bench.md").read_text()


def test_a_part_that_does_not_exist_is_refused(tmp_path):
    done = subprocess.run(
        [sys.executable, "benchmarks/bench.py", "--only", "table4"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert "table4" in done.stderr
