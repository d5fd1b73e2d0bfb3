"""The benchmark runs from end to end, on little work and without optional peers."""

import importlib
import json
import subprocess
import sys
from pathlib import Path

import pytest


ROOT = Path(__file__).parents[2]


def bench(
    *options: object, script: str = "bench.py"
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, f"benchmarks/{script}", *map(str, options)],
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


def test_targets_are_ratios_of_what_was_measured(monkeypatch):
    """One that is met at larger errors says so."""
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    targets = importlib.import_module("parts.targets")

    def entry(name, seconds, rmse, **more):
        known = {"everything_seconds": 2 * seconds, "w1": 0.01, "peak_mb": 500}
        return {"name": name, "seconds": seconds, "rmse": rmse, **known, **more}

    entries = [
        entry("Dr.Jit", 1.2, 0.06, peer=True, ratio_march=12.0),
        entry("cloudjax, 2 steps, 1 node", 0.1, 0.07, peer=False),
        entry("cloudjax, 6 steps, 3 nodes", 0.2, 0.03, peer=False),
    ]
    row = {"title": targets.DISC, "gtx1650_ms": 195, "entries": entries}
    text = targets.tables({"table3": {"rows": [row]}})
    assert "| whole picture against Dr.Jit, 6 steps, 3 nodes | 3x | 3x | 6x |" in text
    assert "2 steps, 1 node (errors larger) | 6x | 4x | 8x |" in text
    assert "at equal or smaller error | 12x | 10x | 20x |" in text
    assert "against the paper's GTX 1650 | 0.97x | 0.5x | 1x |" in text
    assert "| 0.5 GB | 1 GB | 0.5 GB |" in text
    assert not targets.tables({"displacement": {}})


def test_a_part_that_does_not_exist_is_refused():
    done = bench("--only", "table4")
    assert done.returncode == 2
    assert "table4" in done.stderr


@pytest.mark.slow
def test_pictures_and_derivatives_of_a_device_are_timed(tmp_path, monkeypatch):
    monkeypatch.setenv("CLOUDJAX_DATA", str(tmp_path))
    done = bench(
        "--devices", "cpu", "--pixels", 60, "-o", tmp_path, script="devices.py"
    )
    assert done.returncode == 0, done.stderr
    text = (tmp_path / "devices.md").read_text()
    assert "disc 60², 2 steps, 1 nodes, prepared" in text
    assert "gradient, 3600 rays" in text


def test_a_device_that_is_not_there_is_refused(tmp_path):
    done = bench("--devices", "tpu", "-o", tmp_path, script="devices.py")
    assert done.returncode == 2
    assert "--devices" in done.stderr
    assert not any(tmp_path.iterdir())
